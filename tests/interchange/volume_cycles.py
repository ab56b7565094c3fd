"""Blender's Cycles (package bpy): the scenes of `rubor chart --volume --export`, by volumetric path tracing on the processor.

    python volume_cycles.py SAMPLES FOLDER..

Light that was scattered inside is a picture less the same one with a medium that only absorbs, as in volume_mitsuba.py. A
white card tells the unit of lamps. Masking of microfacets is `1 / (1 + Lambda + Lambda)`, and where Cycles looks for a lamp it counts
microfacets that face away too (volume_cycles_lobe.py), so the light to compare with is `scattered-all-facets`.
"""

import math
import sys
import tempfile
from pathlib import Path

import bpy
import numpy
from mathutils import Matrix, Vector

from volume_scene import PASSES, Scene, write


def empty(width, height, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.world = bpy.data.worlds.new("black")
    scene.world.color = (0, 0, 0)
    # A new world may have a grey background of its own.
    for node in scene.world.node_tree.nodes if scene.world.node_tree else ():
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    for kind in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
        setattr(cycles, "max_bounces" if kind == "max" else f"{kind}_bounces", 1024)
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.blur_glossy = 0
    cycles.min_light_bounces = cycles.min_transparent_bounces = 64
    cycles.light_sampling_threshold = 0
    cycles.pixel_filter_type = "BOX"
    return scene


def camera(scene, position, target, up, fov_y_degrees):
    thing = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    backward = (Vector(position) - Vector(target)).normalized()
    right = Vector(up).cross(backward).normalized()
    upward = backward.cross(right)
    turn = Matrix((right, upward, backward)).transposed().to_4x4()
    thing.matrix_world = Matrix.Translation(position) @ turn
    thing.data.sensor_fit = "VERTICAL"
    thing.data.angle_y = math.radians(fov_y_degrees)
    thing.data.clip_start, thing.data.clip_end = 1.0, 1e5
    scene.collection.objects.link(thing)
    scene.camera = thing


def lamp(scene, described, units):
    directional = described["kind"] == "directional"
    kind = "SUN" if directional else "POINT"
    power = numpy.array(described["power"])
    strength = float(power.max())
    data = bpy.data.lights.new("lamp", kind)
    data.color = (power / strength).tolist() if strength > 0 else (0, 0, 0)
    thing = bpy.data.objects.new("lamp", data)
    if directional:
        data.angle = 0
        data.energy = strength / units["SUN"]
        thing.rotation_euler = Vector(described["direction"]).to_track_quat("-Z", "Y").to_euler()
    else:
        data.shadow_soft_size = 0
        # From metres to the millimetres of the scene.
        data.energy = 1e6 * strength / units["POINT"]
        thing.location = described["positionMm"]
    scene.collection.objects.link(thing)


def mesh(scene, name, points, triangles, material):
    data = bpy.data.meshes.new(name)
    data.from_pydata(points.tolist(), [], triangles.tolist())
    data.materials.append(material)
    assert not any(p.use_smooth for p in data.polygons), "facets"
    scene.collection.objects.link(bpy.data.objects.new(name, data))


def shader(name):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    nodes = material.node_tree
    return material, nodes, nodes.nodes.new("ShaderNodeOutputMaterial")


def lambertian(reflectance):
    material, tree, out = shader("lambertian")
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (reflectance,) * 3 + (1,)
    tree.links.new(node.outputs[0], out.inputs["Surface"])
    return material


def flesh(scattering, absorption, eta, alpha):
    material, tree, out = shader("flesh")
    glass = tree.nodes.new("ShaderNodeBsdfGlass")
    glass.distribution = "GGX"
    glass.inputs["Color"].default_value = (1, 1, 1, 1)
    glass.inputs["Roughness"].default_value = math.sqrt(alpha)
    glass.inputs["IOR"].default_value = eta
    tree.links.new(glass.outputs[0], out.inputs["Surface"])
    both = tree.nodes.new("ShaderNodeAddShader")
    # Density times colour scatters; density times what the colour lacks of one absorbs.
    for slot, kind, values in ((0, "Scatter", scattering), (1, "Absorption", absorption)):
        node = tree.nodes.new(f"ShaderNodeVolume{kind}")
        most = float(values.max())
        color = values / most if most > 0 else values
        node.inputs["Color"].default_value = (*(color if kind == "Scatter" else 1 - color), 1)
        node.inputs["Density"].default_value = most
        tree.links.new(node.outputs[0], both.inputs[slot])
    tree.links.new(both.outputs[0], out.inputs["Volume"])
    if hasattr(material.cycles, "homogeneous_volume"):
        material.cycles.homogeneous_volume = True
    # No light gets from a collision to a lamp past the boundary: flights are all that counts.
    if hasattr(material.cycles, "volume_sampling"):
        material.cycles.volume_sampling = "DISTANCE"
    return material


def picture(scene, seed):
    scene.cycles.seed = seed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        flat = numpy.empty(len(image.pixels), "f4")
        image.pixels.foreach_get(flat)
        size = image.size[1], image.size[0]
        bpy.data.images.remove(image)
    # Rows from the bottom.
    return flat.reshape(*size, 4)[::-1, :, :3].astype("f8")


def units():
    """Irradiance (sun) and radiant intensity (point) of lamps of energy 1, by a white card 1000 mm away."""
    found = {}
    for kind in ("SUN", "POINT"):
        scene = empty(8, 8, 16)
        card = numpy.array([[-100, -100, 0], [100, -100, 0], [100, 100, 0], [-100, 100, 0]], float)
        mesh(scene, "card", card, numpy.array([[0, 1, 2], [0, 2, 3]]), lambertian(1.0))
        described = {
            "kind": "directional" if kind == "SUN" else "point",
            "power": [1, 1, 1],
            "direction": [0, 0, -1],
            "positionMm": [0, 0, 1000],
        }
        lamp(scene, described, {"SUN": 1.0, "POINT": 1.0})
        camera(scene, (0, 0, 500), (0, 0, 0), (0, 1, 0), 1)
        # A white card returns irradiance / pi; 1000 mm away that of our unit of intensity is 1.
        found[kind] = float(math.pi * picture(scene, 0).mean())
    return found


def drawn(described, black, samples, seed, unit):
    scene = empty(described.width, described.height, samples)
    medium, view = described.json["medium"], described.json["camera"]
    camera(scene, view["positionMm"], view["targetMm"], view["up"], view["fovYDegrees"])
    for each in described.json["lamps"]:
        lamp(scene, each, unit)
    scattering, extinction = described.coefficients()
    if black:
        scattering = numpy.zeros(3)
    inside = flesh(scattering, extinction - scattering, medium["eta"], medium["alpha"])
    mesh(scene, "surface", *described.mesh("surface"), inside)
    mesh(scene, "blockers", *described.mesh("blockers"), lambertian(0.0))
    return picture(scene, seed)


def main():
    samples = int(sys.argv[1])
    unit = units()
    print("energy 1 is", unit, flush=True)
    for folder in sys.argv[2:]:
        scene = Scene(folder)
        share = max(samples // PASSES, 1)
        both = lambda i: drawn(scene, False, share, i, unit) - drawn(scene, True, share, 100 + i, unit)
        passes = [both(i) for i in range(PASSES)]
        write(scene, "cycles", f"Cycles {bpy.app.version_string}", passes)


if __name__ == "__main__":
    main()
