"""Mitsuba 3 (package mitsuba): the scenes of `rubor chart --volume --export`, by volumetric path tracing.

    python volume_mitsuba.py SAMPLES FOLDER..

Light that was scattered inside is a picture less the same one with a medium that only absorbs: what is left out is what the
surface alone reflects and what passes unscattered. Masking of microfacets is separable, as in Walter et al. 2007.
"""

import sys

import mitsuba
import numpy

mitsuba.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as Transform  # noqa: E402

from volume_scene import PASSES, Scene, write  # noqa: E402


def lamps(scene):
    for i, lamp in enumerate(scene.json["lamps"]):
        color = {"type": "rgb", "value": lamp["power"]}
        if lamp["kind"] == "directional":
            yield f"lamp{i}", {"type": "directional", "direction": lamp["direction"], "irradiance": color}
        else:
            # From metres to the millimetres of the scene.
            color["value"] = [1e6 * v for v in lamp["power"]]
            yield f"lamp{i}", {"type": "point", "position": lamp["positionMm"], "intensity": color}


def drawn(scene, black, samples, seed):
    scattering, extinction = scene.coefficients()
    albedo = numpy.zeros(3) if black else scattering / extinction
    medium, camera = scene.json["medium"], scene.json["camera"]
    scale = float(extinction.max())
    loaded = mitsuba.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 64},
        "sensor": {
            "type": "perspective",
            "fov": camera["fovYDegrees"],
            "fov_axis": "y",
            "near_clip": 1.0,
            "far_clip": 1e5,
            "to_world": Transform().look_at(origin=camera["positionMm"], target=camera["targetMm"], up=camera["up"]),
            "film": {
                "type": "hdrfilm",
                "width": scene.width,
                "height": scene.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent", "sample_count": samples},
        },
        "surface": {
            "type": "ply",
            "filename": str(scene.folder / "surface.ply"),
            "face_normals": True,
            "boundary": {
                "type": "roughdielectric",
                "distribution": "ggx",
                "alpha": medium["alpha"],
                "int_ior": medium["eta"],
                "ext_ior": 1.0,
            },
            "interior": {
                "type": "homogeneous",
                "albedo": {"type": "rgb", "value": albedo.tolist()},
                "sigma_t": {"type": "rgb", "value": (extinction / scale).tolist()},
                "scale": scale,
                "phase": {"type": "isotropic"},
            },
        },
        "blockers": {
            "type": "ply",
            "filename": str(scene.folder / "blockers.ply"),
            "face_normals": True,
            "black": {"type": "twosided", "inner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}},
        },
        **dict(lamps(scene)),
    })
    return numpy.array(mitsuba.render(loaded, spp=samples, seed=seed))


samples = int(sys.argv[1])
for folder in sys.argv[2:]:
    scene = Scene(folder)
    share = max(samples // PASSES, 1)
    passes = [drawn(scene, False, share, i) - drawn(scene, True, share, 100 + i) for i in range(PASSES)]
    write(scene, "mitsuba", f"Mitsuba {mitsuba.__version__}", passes)
