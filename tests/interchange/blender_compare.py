"""Blender (package bpy): vertices of an exported head at the times of the reference, and a picture.

    python blender_compare.py HEAD.glb REFERENCE_FOLDER
"""

import json
import sys
from pathlib import Path

import bpy
import numpy

glb, folder = sys.argv[1], Path(sys.argv[2])
reference = json.loads((folder / "reference.json").read_text())
expected = numpy.fromfile(folder / "vertices.bin", "<f4").reshape(len(reference["times"]), -1, 3)

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 24
bpy.ops.import_scene.gltf(filepath=glb, merge_vertices=False)
heads = [o for o in scene.objects if o.type == "MESH" and o.data.shape_keys]
assert len(heads) == 1, [o.name for o in heads]
head = heads[0]
names = [k.name for k in head.data.shape_keys.key_blocks][1:]
assert names == reference["names"], "names of shapes"


def vertices():
    evaluated = head.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = numpy.empty(3 * len(mesh.vertices), "f4")
    mesh.vertices.foreach_get("co", flat)
    world = numpy.array(evaluated.matrix_world)
    points = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    evaluated.to_mesh_clear()
    # Blender is Z up.
    return numpy.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


worst = 0.0
for time, positions in zip(reference["times"], expected):
    frame = time * 24
    scene.frame_set(int(frame), subframe=frame - int(frame))
    found = vertices()
    assert found.shape == positions.shape, (found.shape, positions.shape)
    worst = max(worst, float(numpy.linalg.norm(found - positions, axis=1).max()))
share = worst / reference["heightMetres"]
print(f"Blender {bpy.app.version_string}: {share:.2e} of the head's height at most")

frame = reference["times"][5] * 24
scene.frame_set(int(frame), subframe=frame - int(frame))
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
middle = vertices().mean(axis=0)
camera.location = (middle[0], -middle[2] - 1.0, middle[1])
camera.rotation_euler = (1.5708, 0, 0)
camera.data.angle = 0.4
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy = 3
sun.rotation_euler = (0.9, -0.4, 0)
for thing in (camera, sun):
    scene.collection.objects.link(thing)
scene.camera = camera
scene.world = bpy.data.worlds.new("world")
scene.render.engine = "CYCLES"
scene.cycles.samples = 8
scene.render.resolution_x = scene.render.resolution_y = 400
scene.render.filepath = str(folder / "blender.png")
if "--picture" in sys.argv:
    bpy.ops.render.render(write_still=True)
sys.exit(0 if share <= 1e-5 else 1)
