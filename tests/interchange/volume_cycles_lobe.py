"""The refracting lobe of Cycles beside the equation (Walter et al. 2007, eq. 21, with masking 1 / (1 + Lambda + Lambda)).

    python volume_cycles_lobe.py

A camera below a sheet of rough glass (index 1.4, alpha 0.3) looks up at it; a distant lamp of irradiance 1 stands above. Printed: mean
radiance over the picture of Cycles, of the equation, and of the equation without the condition that the microfacet faces the normal and
the lamp, for angles of the lamp from the normal and of the camera's axis inside.
"""

import math

import numpy

from volume_cycles import camera, empty, flesh, lamp, mesh, picture, units

ETA, ALPHA, SIZE, FOV = 1.4, 0.3, 64, 50
CASES = [(10, 0), (10, 55), (60, 0), (60, 50), (60, 65), (75, 30), (75, 60), (60, -50)]


def equation(to_lamp, back, all_facets):
    """Radiance along -back, over the square of the index, for the irradiance 1 across the light."""
    def hidden(cosine):
        return 0.5 * (numpy.sqrt(1 + ALPHA**2 * (1 - cosine**2) / cosine**2) - 1)

    def fresnel(cosine):
        beyond = numpy.sqrt(1 - (1 - cosine**2) / ETA**2)
        first = (cosine - beyond / ETA) / (cosine + beyond / ETA)
        second = (cosine / ETA - beyond) / (cosine / ETA + beyond)
        return 0.5 * (first**2 + second**2)

    h = -(to_lamp + ETA * back)
    h /= numpy.linalg.norm(h, axis=2, keepdims=True)
    lh, wh, nh = h @ to_lamp, (h * back).sum(axis=2), h[..., 2]
    cos_l, cos_w = to_lamp[2], numpy.abs(back[..., 2])
    facets = ALPHA**2 / (math.pi * (nh**2 * (ALPHA**2 - 1) + 1) ** 2)
    masked = 1 / (1 + hidden(cos_l) + hidden(cos_w))
    lobe = numpy.abs(lh * wh) / (cos_l * cos_w) * (1 - fresnel(numpy.clip(numpy.abs(lh), 1e-6, 1))) * facets * masked
    lobe = lobe / (lh + ETA * wh) ** 2 * cos_l
    return lobe if all_facets else numpy.where((lh > 0) & (nh > 0), lobe, 0)


unit = units()
for lamp_degrees, tilt_degrees in CASES:
    scene = empty(SIZE, SIZE, 64)
    scene.cycles.max_bounces = 1
    angle, tilt = math.radians(lamp_degrees), math.radians(tilt_degrees)
    to_lamp = numpy.array([math.sin(angle), 0, math.cos(angle)])
    lamp(scene, {"kind": "directional", "power": [1, 1, 1], "direction": (-to_lamp).tolist()}, unit)
    sheet = 1e4 * numpy.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    nothing = numpy.zeros(3)
    mesh(scene, "sheet", sheet, numpy.array([[0, 1, 2], [0, 2, 3]]), flesh(nothing, nothing, ETA, ALPHA))
    camera(scene, (0, 0, -100), (100 * math.tan(tilt), 0, 0), (0, 1, 0), FOV)
    found = picture(scene, 1)[:, :, 0]
    y, x = numpy.mgrid[0:SIZE, 0:SIZE]
    right_of, up_of = (2 * (x + 0.5) / SIZE - 1)[..., None], (1 - 2 * (y + 0.5) / SIZE)[..., None]
    forward = numpy.array([math.sin(tilt), 0, math.cos(tilt)])
    right = numpy.cross(forward, [0, 1, 0])
    rays = forward + math.tan(math.radians(FOV / 2)) * (right_of * right + up_of * numpy.array([0, 1, 0]))
    rays /= numpy.linalg.norm(rays, axis=2, keepdims=True)
    is_upward = rays[..., 2] > 0.02
    expected = [numpy.where(is_upward, equation(to_lamp, -rays, every), 0).mean() for every in (False, True)]
    found = numpy.where(is_upward, found, 0).mean()
    print(f"lamp {lamp_degrees}, camera {tilt_degrees}: Cycles {found:.5f}, equation {expected[0]:.5f}, with all facets {expected[1]:.5f}")
