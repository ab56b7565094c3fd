"""All calls into Maya. They return plain data and make no decisions."""

import maya.cmds as cmds


class MayaHost:
    """The package's only interface to Maya."""

    def selection(self):
        """Long paths of selected transforms and meshes."""
        return cmds.ls(selection=True, long=True) or []

    def blend_shapes(self, path):
        """Blend shape nodes in the history of a path and of the meshes below it."""
        meshes = cmds.listRelatives(path, allDescendents=True, type="mesh", fullPath=True) or []
        nodes = []
        for node in [path] + meshes:
            for found in cmds.ls(cmds.listHistory(node) or [], type="blendShape"):
                if found not in nodes:
                    nodes.append(found)
        return nodes

    def weights(self, node):
        """Name and value of each weight of a blend shape node now."""
        indices = cmds.getAttr(node + ".weight", multiIndices=True) or []
        result = {}
        for index in indices:
            plug = "{}.weight[{}]".format(node, index)
            name = cmds.aliasAttr(plug, query=True) or "weight_{}".format(index)
            result[name] = cmds.getAttr(plug)
        return result

    def rotation_degrees(self, path):
        """World rotation of a transform as rows of a 3 x 3 matrix (Maya's row vectors)."""
        values = cmds.xform(path, query=True, worldSpace=True, matrix=True)
        return [values[0:3], values[4:7], values[8:11]]

    def export_scene(self, paths, file):
        """Writes the paths with their history as Maya ASCII."""
        previous = self.selection()
        cmds.select(paths, replace=True)
        try:
            cmds.file(
                file, force=True, type="mayaAscii", exportSelected=True, constructionHistory=True, channels=True,
                expressions=False, shader=True,
            )
        finally:
            if previous:
                cmds.select(previous, replace=True)
            else:
                cmds.select(clear=True)

    def frames_per_second(self):
        """Frames per second of the scene's unit of time."""
        names = {"game": 15.0, "film": 24.0, "pal": 25.0, "ntsc": 30.0, "show": 48.0, "palf": 50.0, "ntscf": 60.0}
        unit = cmds.currentUnit(query=True, time=True)
        return names.get(unit) or float(unit.replace("fps", "").replace("df", ""))

    def first_frame(self):
        """Start of the playback range."""
        return cmds.playbackOptions(query=True, minTime=True)

    def set_keys(self, node, weight, keys):
        """Replaces the keys of a weight. keys: (frame, value, in tangent, out tangent)."""
        plug = "{}.{}".format(node, weight)
        cmds.cutKey(plug, clear=True)
        for frame, value, _, _ in keys:
            cmds.setKeyframe(plug, time=frame, value=value)
        for frame, _, incoming, outgoing in keys:
            cmds.keyTangent(plug, time=(frame, frame), inTangentType=incoming, outTangentType=outgoing)

    def on_change(self, callback):
        """Calls back after each change of time or idle moment; returns a handle for `stop`."""
        return [
            cmds.scriptJob(event=["timeChanged", callback]),
            cmds.scriptJob(event=["idle", callback]),
        ]

    def stop(self, handle):
        """Ends the calls."""
        for job in handle:
            if cmds.scriptJob(exists=job):
                cmds.scriptJob(kill=job)

    def ask_file(self, title, pattern, saving):
        """Path that the user chose, or none."""
        chosen = cmds.fileDialog2(caption=title, fileFilter=pattern, fileMode=0 if saving else 1)
        return chosen[0] if chosen else None

    def say(self, message):
        """Shows a message in the viewport and the script editor."""
        cmds.inViewMessage(assistMessage=message, position="topCenter", fade=True)
        print("rubor: " + message)

    def add_menu(self, label, entries):
        """A menu of (label, function); returns its name."""
        menu = cmds.menu(label=label, parent="MayaWindow", tearOff=True)
        for text, command in entries:
            cmds.menuItem(label=text, parent=menu, command=lambda *_, run=command: run())
        return menu

    def remove_menu(self, menu):
        """Removes a menu."""
        if cmds.menu(menu, exists=True):
            cmds.deleteUI(menu)
