"""Renders the OSL shader on a plane with Blender's Cycles: one texel of the maps a pixel.

Usage: python osl_chart.py FOLDER, where FOLDER/chart.json has the parameters and the side of the chart.
Writes FOLDER/chart_out.json: linear colour and normal of each pixel, rows from the top.
"""

import json
import pathlib
import sys

import bpy
import _cycles  # with bpy: the compiler of OSL

folder = pathlib.Path(sys.argv[1])
chart = json.loads((folder / "chart.json").read_text())
side = chart["side"]

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.shading_system = True
scene.cycles.samples = 1
scene.cycles.use_denoising = False
# Rays go through the middle of pixels, where texels stand.
scene.cycles.pixel_filter_type = "BOX"
scene.cycles.filter_width = 0.01
scene.render.resolution_x = scene.render.resolution_y = side
scene.render.resolution_percentage = 100
scene.view_settings.view_transform = "Raw"
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"

camera_data = bpy.data.cameras.new("camera")
camera_data.type = "ORTHO"
camera_data.ortho_scale = 2.0
camera = bpy.data.objects.new("camera", camera_data)
camera.location = (0, 0, 5)
scene.collection.objects.link(camera)
scene.camera = camera

bpy.ops.mesh.primitive_plane_add(size=2.0)
plane = bpy.context.object
material = bpy.data.materials.new("skin")
material.use_nodes = True
plane.data.materials.append(material)
nodes, links = material.node_tree.nodes, material.node_tree.links
nodes.clear()
script = nodes.new("ShaderNodeScript")
script.mode = "EXTERNAL"
compiled = folder / "rubor_skin.oso"
success = _cycles.osl_compile(str(folder / "rubor_skin.osl"), str(compiled))
if not (success[0] if isinstance(success, tuple) else success):
    sys.exit(f"rubor_skin.osl does not compile: {success}")
# Blender's own list of parameters needs a module that the package bpy lacks: sockets are made by hand.
SOCKETS = {str: "NodeSocketString", int: "NodeSocketInt", float: "NodeSocketFloat"}
for name, value in chart["parameters"].items():
    script.inputs.new(SOCKETS[type(value)], name)
script.inputs.new("NodeSocketVector", "uv")
script.outputs.new("NodeSocketColor", "outColor")
script.outputs.new("NodeSocketVector", "outNormal")
script.filepath = str(compiled)
coordinates = nodes.new("ShaderNodeTexCoord")
links.new(coordinates.outputs["UV"], script.inputs["uv"])
emission = nodes.new("ShaderNodeEmission")
output = nodes.new("ShaderNodeOutputMaterial")
links.new(emission.outputs[0], output.inputs["Surface"])

by_name = {socket.name: socket for socket in script.inputs}
for name, value in chart["parameters"].items():
    by_name[name].default_value = str(folder / value) if isinstance(value, str) else value

result = {}
for what in ("outColor", "outNormal"):
    for link in list(emission.inputs["Color"].links):
        links.remove(link)
    links.new(script.outputs[what], emission.inputs["Color"])
    path = folder / f"{what}.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = list(image.pixels)
    # Blender's rows start at the bottom.
    rows = [pixels[4 * side * y : 4 * side * (y + 1)] for y in reversed(range(side))]
    result[what] = [row[4 * x : 4 * x + 3] for row in rows for x in range(side)]
(folder / "chart_out.json").write_text(json.dumps(result))
