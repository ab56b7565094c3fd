"""The actions of the menu entries."""

from . import live, sequences

_state = {"menu": None, "host": None, "link": None}


def install(host):
    """Adds the menu once."""
    uninstall()
    _state["host"] = host
    entries = [
        ("Export selected head...", lambda: guarded(host, export_selected)),
        ("Send weights live to a viewer", lambda: guarded(host, start_live)),
        ("Stop sending", lambda: guarded(host, stop_live)),
        ("Import a sequence...", lambda: guarded(host, import_sequence)),
    ]
    _state["menu"] = host.add_menu("rubor", entries)


def uninstall():
    """Removes the menu and ends the link."""
    host = _state["host"]
    if _state["link"] is not None:
        _state["link"].stop()
    if host is not None and _state["menu"] is not None:
        host.remove_menu(_state["menu"])
    _state.update(menu=None, host=None, link=None)


def guarded(host, action):
    """An error becomes a message, never a traceback in the artist's face."""
    try:
        action(host)
    except (sequences.SequenceError, OSError, ValueError) as error:
        host.say(str(error))


def chosen(host):
    """The selected head."""
    selected = host.selection()
    if len(selected) != 1:
        raise ValueError("found {} selected objects, expected one head".format(len(selected)))
    return selected[0]


def export_selected(host):
    """Writes the selected head as .ma, which `rubor maya import` reads."""
    path = chosen(host)
    if not host.blend_shapes(path):
        raise ValueError("{} has no blend shapes".format(path))
    file = host.ask_file("Export head for rubor", "Maya ASCII (*.ma)", True)
    if file:
        host.export_scene([path], file)
        host.say("written: {}. Next: rubor maya import {} -o head.glb".format(file, file))


def start_live(host):
    """Connects the selected head to a viewer on this machine."""
    path = chosen(host)
    stop_live(host)
    try:
        link = live.LiveLink(host, path)
    except OSError as error:
        raise ValueError(
            "no viewer answers ({}): start one with `rubor view HEAD --live`".format(error)
        ) from error
    _state["link"] = link
    link.start()
    host.say("sending {}".format(path))


def stop_live(host):
    """Ends the link."""
    if _state["link"] is not None:
        _state["link"].stop()
        _state["link"] = None
        host.say("stopped sending")


def import_sequence(host):
    """Keys the selected head from a sequence."""
    path = chosen(host)
    file = host.ask_file("Import a rubor sequence", "Sequence (*.json)", False)
    if not file:
        return
    sequence = sequences.load(file)
    missing = sequences.apply(host, path, sequence)
    if sequence.get("expressions") or sequence.get("states"):
        missing.append("expressions and states (write them with `rubor maya export`)")
    host.say("keyed" if not missing else "keyed; without: " + ", ".join(missing))
