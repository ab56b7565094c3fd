"""Tests of rubor_maya without Maya: python3 -m unittest discover -s maya-bridge/python/tests"""

import ast
import json
import math
import os
import pathlib
import socket
import sys
import tempfile
import threading
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from rubor_maya import live, menu, messages, sequences  # noqa: E402


class FakeHost:
    """A Maya of one head with two blend shape nodes."""

    def __init__(self):
        self.nodes = {"face_bs": {"jawOpen": 0.0, "eyeBlink_L": 0.0, "eyeBlink_R": 0.0}, "teeth_bs": {"jawOpen": 0.0}}
        self.selected = ["|head"]
        self.rows = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        self.said, self.exported, self.keyed, self.callbacks = [], [], {}, []
        self.file = None

    def selection(self):
        return self.selected

    def blend_shapes(self, path):
        return list(self.nodes) if path == "|head" else []

    def weights(self, node):
        return dict(self.nodes[node])

    def rotation_degrees(self, path):
        return self.rows

    def export_scene(self, paths, file):
        self.exported.append((paths, file))

    def frames_per_second(self):
        return 24.0

    def first_frame(self):
        return 1.0

    def set_keys(self, node, weight, keys):
        self.keyed[node, weight] = keys

    def on_change(self, callback):
        self.callbacks.append(callback)
        return [1]

    def stop(self, handle):
        self.callbacks.clear()

    def ask_file(self, title, pattern, saving):
        return self.file

    def say(self, message):
        self.said.append(message)

    def add_menu(self, label, entries):
        self.entries = dict(entries)
        return label

    def remove_menu(self, name):
        self.entries = {}


class Viewer:
    """Collects the lines that one connection sends."""

    def __init__(self):
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.lines = []
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        connection, _ = self.server.accept()
        with connection, connection.makefile("rb") as stream:
            for text in stream:
                self.lines.append(json.loads(text))

    def close(self):
        self.thread.join(5)
        self.server.close()


def rotation(yaw, pitch, roll):
    """Maya's rows of yaw times pitch times roll, degrees."""
    y, p, r = (math.radians(a) for a in (yaw, pitch, roll))
    cy, sy, cp, sp, cr, sr = math.cos(y), math.sin(y), math.cos(p), math.sin(p), math.cos(r), math.sin(r)
    matrix = [
        [cy * cr + sy * sp * sr, -cy * sr + sy * sp * cr, sy * cp],
        [cp * sr, cp * cr, -sp],
        [-sy * cr + cy * sp * sr, sy * sr + cy * sp * cr, cy * cp],
    ]
    return [list(row) for row in zip(*matrix)]


class Messages(unittest.TestCase):
    def test_only_changes_are_sent(self):
        self.assertEqual(messages.changed({}, {"a": 0.0, "b": 1.0}), {"a": 0.0, "b": 1.0})
        self.assertEqual(messages.changed({"a": 0.0, "b": 1.0}, {"a": 1e-7, "b": 0.5}), {"b": 0.5})
        self.assertEqual(messages.changed({"a": 0.5, "z": 0.0}, {}), {"a": 0.0})
        self.assertEqual(messages.changed({}, {"a": float("nan")}), {})

    def test_a_line_is_one_line_and_refuses_nonsense(self):
        text = messages.line({"type": "weights", "shapes": {"odd\nname": 1.0}})
        self.assertEqual(text.count(b"\n"), 1)
        with self.assertRaises(ValueError):
            messages.line({"x": float("inf")})

    def test_angles_of_rotations(self):
        for angles in [(0, 0, 0), (30, -20, 10), (-170, 45, -60), (5, 89, 0), (12, 90, 0)]:
            found = messages.head_angles([[3 * c for c in row] for row in rotation(*angles)])
            values = (found["yawDegrees"], found["pitchDegrees"], found["rollDegrees"])
            for value, expected in zip(values, angles):
                self.assertAlmostEqual(value, expected, places=4, msg=str(angles))


class Live(unittest.TestCase):
    def test_a_viewer_gets_hello_all_weights_changes_and_bye(self):
        viewer, host = Viewer(), FakeHost()
        link = live.LiveLink(host, "|head", viewer.port)
        link.start()
        host.nodes["face_bs"]["eyeBlink_L"] = 0.75
        host.callbacks[0]()
        host.callbacks[0]()
        host.rows = rotation(15, 0, 0)
        host.callbacks[0]()
        link.stop()
        viewer.close()
        kinds = [line["type"] for line in viewer.lines]
        self.assertEqual(kinds, ["hello", "weights", "weights", "weights", "bye"])
        self.assertEqual(set(viewer.lines[1]["shapes"]), {"jawOpen", "eyeBlink_L", "eyeBlink_R"})
        self.assertEqual(viewer.lines[2], {"type": "weights", "shapes": {"eyeBlink_L": 0.75}})
        self.assertAlmostEqual(viewer.lines[3]["head"]["yawDegrees"], 15.0, places=5)
        self.assertEqual(host.callbacks, [])

    def test_a_lost_viewer_ends_the_link_quietly(self):
        class Broken:
            sent = 0

            def sendall(self, data):
                self.sent += 1
                if self.sent > 2:
                    raise BrokenPipeError("gone")

            def close(self):
                pass

        host = FakeHost()
        link = live.LiveLink(host, "|head", 1, connect=lambda address: Broken())
        link.start()
        host.nodes["face_bs"]["jawOpen"] = 1.0
        link.update()
        link.update()
        self.assertEqual(len(host.said), 1)
        self.assertIn("gone", host.said[0])
        self.assertEqual(host.callbacks, [])


class Sequences(unittest.TestCase):
    def test_comments_and_trailing_commas(self):
        text = '{ // note\n "a": "// no comment, }", /* more\n */ "b": [1, 2,], "c": {"d": 1, /* x */ }, }'
        stripped = sequences.strip_comments(text)
        self.assertEqual(json.loads(stripped), {"a": "// no comment, }", "b": [1, 2], "c": {"d": 1}})
        self.assertEqual(stripped.count("\n"), text.count("\n"))

    def test_keys_follow_the_easing_at_every_frame(self):
        for name in ("smoother", "easeIn", "easeOut", "easeInOut"):
            track = [{"t": 0.1, "v": 0.2, "ease": name}, {"t": 1, "v": 0.8}]
            found = sequences.keys(track, 24.0, 1.0)
            self.assertAlmostEqual(found[0][0], 3.4, places=9)
            self.assertEqual(found[-1][0], 25.0)
            for frame, value, _, _ in found:
                share = ((frame - 1.0) / 24.0 - 0.1) / 0.9
                self.assertAlmostEqual(value, 0.2 + 0.6 * sequences.ease(name, share), places=9)
            self.assertEqual(len(found), 2 + 21)
        exact = sequences.keys([{"t": 0, "v": 0, "ease": "smooth"}, {"t": 1, "v": 1, "ease": "step"}, {"t": 2, "v": 0}], 24.0)
        self.assertEqual([k[2:] for k in exact], [("linear", "flat"), ("flat", "step"), ("linear", "linear")])
        self.assertEqual(sequences.keys(0.5, 24.0, 1.0), [(1.0, 0.5, "linear", "linear")])
        for wrong in ([], "x", [{"t": 0}], [3], [{"t": 0, "v": 0, "ease": "bounce"}]):
            with self.assertRaises(sequences.SequenceError):
                sequences.keys(wrong, 24.0)

    def test_names_in_any_spelling(self):
        for name in ("eyeBlink_L", "eyeBlinkLeft", "EYEBLINK-LEFT", "eyeBlinkL", "ns:eyeBlink_L"):
            self.assertEqual(sequences.canonical(name), "eyeblinkleft", name)
        self.assertEqual(sequences.canonical("mouthRollLower"), "mouthrolllower")

    def test_a_sequence_keys_every_node_and_names_what_is_missing(self):
        host = FakeHost()
        missing = sequences.apply(host, "|head", {"shapes": {"JawOpen": 0.4, "eyeBlink": 1, "tongueOut": 1}})
        self.assertEqual(missing, ["tongueOut"])
        self.assertEqual(set(host.keyed), {("face_bs", "jawOpen"), ("teeth_bs", "jawOpen"), ("face_bs", "eyeBlink_L"), ("face_bs", "eyeBlink_R")})


class Menu(unittest.TestCase):
    def setUp(self):
        self.host = FakeHost()
        menu.install(self.host)

    def tearDown(self):
        menu.uninstall()

    def test_export_and_import(self):
        self.host.file = "/tmp/head.ma"
        self.host.entries["Export selected head..."]()
        self.assertEqual(self.host.exported, [(["|head"], "/tmp/head.ma")])
        with tempfile.TemporaryDirectory() as folder:
            self.host.file = os.path.join(folder, "s.json")
            pathlib.Path(self.host.file).write_text('{"fps": 24, "duration": 1, "shapes": {"jawOpen": 1}, }')
            self.host.entries["Import a sequence..."]()
            self.assertIn(("face_bs", "jawOpen"), self.host.keyed)
            pathlib.Path(self.host.file).write_text("{")
            self.host.entries["Import a sequence..."]()
        self.assertIn("s.json", self.host.said[-1])

    def test_mistakes_are_said(self):
        self.host.selected = []
        self.host.entries["Export selected head..."]()
        self.assertEqual(self.host.said[-1], "found 0 selected objects, expected one head")
        self.host.selected = ["|lamp"]
        self.host.entries["Export selected head..."]()
        self.assertEqual(self.host.said[-1], "|lamp has no blend shapes")
        self.assertEqual(self.host.exported, [])


class Layers(unittest.TestCase):
    def test_only_the_host_calls_maya_and_it_has_what_is_used(self):
        methods = set()
        for path in (ROOT / "rubor_maya").glob("*.py"):
            tree = ast.parse(path.read_text())
            names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
            self.assertEqual(any(n.startswith("maya") for n in names), path.name == "host.py", path.name)
            if path.name == "host.py":
                for node in ast.walk(tree):
                    if isinstance(node, ast.FunctionDef) and node.args.args:
                        methods.add((node.name, len(node.args.args)))
        fake = {
            (name, function.__code__.co_argcount)
            for name, function in vars(FakeHost).items()
            if callable(function) and not name.startswith("_")
        }
        self.assertEqual(methods, fake)


if __name__ == "__main__":
    unittest.main()
