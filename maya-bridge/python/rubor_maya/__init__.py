"""rubor inside Maya: export the selected head, send its weights live to `rubor view`, import a sequence.

Install: put the folder that holds `rubor_maya` on Maya's Python path, then in a Python shelf button or userSetup.py:

    import rubor_maya
    rubor_maya.install_menu()

Every call into Maya stands in `host.py`; everything else is plain Python and is tested without Maya.
"""

__all__ = ["install_menu", "uninstall_menu"]


def install_menu():
    """Adds the menu `rubor` to Maya's main window."""
    from . import host, menu

    menu.install(host.MayaHost())


def uninstall_menu():
    """Removes the menu and stops sending."""
    from . import menu

    menu.uninstall()
