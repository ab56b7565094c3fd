"""Sequences of rubor (sequence.json) as keys of Maya weights."""

import json
import re

# Easings that tangents say exactly, as (out tangent of this key, in tangent of the next one).
_TANGENTS = {
    "linear": ("linear", "linear"),
    "smooth": ("flat", "flat"),
    "step": ("step", "linear"),
}


class SequenceError(ValueError):
    """A sequence that cannot become keys."""


def load(path):
    """Reads a sequence; comments and trailing commas are allowed."""
    with open(path, encoding="utf-8-sig") as file:
        text = file.read()
    try:
        sequence = json.loads(strip_comments(text))
    except ValueError as error:
        raise SequenceError("{}: {}".format(path, error)) from error
    if not isinstance(sequence, dict) or not isinstance(sequence.get("fps"), (int, float)):
        raise SequenceError("{}: found no fps, expected a sequence".format(path))
    return sequence


def strip_comments(text):
    """JSON without // and /* */ comments and trailing commas; texts in quotes stay, and so do line numbers."""
    out = []
    pattern = re.compile(r'"(?:\\.|[^"\\])*"|//[^\n]*|/\*.*?\*/|,(?=\s*[}\]])', re.DOTALL)
    # A comma may be followed by comments before its bracket, so commas go in a second pass.
    for _ in range(2):
        out = []
        end = 0
        for match in pattern.finditer(text):
            out.append(text[end : match.start()])
            found = match.group()
            if found.startswith('"'):
                out.append(found)
            else:
                out.append("\n" * found.count("\n"))
            end = match.end()
        out.append(text[end:])
        text = "".join(out)
    return text


def ease(name, u):
    """Share of the way at a share u of the time, both 0 to 1."""
    if name == "linear":
        return u
    if name == "smooth":
        return u * u * (3 - 2 * u)
    if name == "smoother":
        return u * u * u * (u * (6 * u - 15) + 10)
    if name == "easeIn":
        return u * u
    if name == "easeOut":
        return 1 - (1 - u) * (1 - u)
    if name == "easeInOut":
        return 4 * u**3 if u < 0.5 else 1 - 4 * (1 - u) ** 3
    if name == "step":
        return 0.0 if u < 1 else 1.0
    raise SequenceError("found the ease {!r}, expected one of rubor's".format(name))


def keys(track, fps, first_frame=0.0):
    """Keys (frame, value, in tangent, out tangent) of a track.

    A constant is one key. Easings without tangents like them are sampled at every frame.
    """
    if isinstance(track, (int, float)):
        return [(first_frame, float(track), "linear", "linear")]
    if not isinstance(track, list) or not track:
        raise SequenceError("found {!r}, expected a number or keys".format(track))
    points = []
    for key in track:
        try:
            points.append((float(key["t"]), float(key["v"]), key.get("ease", "linear")))
        except (TypeError, KeyError, AttributeError) as error:
            raise SequenceError("found the key {!r}, expected t and v".format(key)) from error
    result = []
    incoming = "linear"
    for index, (time, value, name) in enumerate(points):
        following = points[index + 1] if index + 1 < len(points) else None
        ease(name, 0.0)
        outgoing, next_incoming = _TANGENTS.get(name, ("linear", "linear"))
        result.append((first_frame + time * fps, value, incoming, outgoing if following else "linear"))
        if following and name not in _TANGENTS:
            end, target = following[0], following[1]
            frame = int(time * fps + 1e-6) + 1
            while frame / fps < end - 1e-9:
                share = ease(name, (frame / fps - time) / (end - time))
                result.append((first_frame + frame, value + (target - value) * share, "linear", "linear"))
                frame += 1
        incoming = next_incoming
    return result


def canonical(name):
    """Spelling of a name that compares: eyeBlink_L, eyeBlinkLeft and EYEBLINK-LEFT are one."""
    stem = re.split(r"[.:|]", name)[-1]
    match = re.match(r"^(.*?)(?:[^A-Za-z0-9]([LlRr])|(?<=[a-z])([LR]))$", stem)
    side = ""
    if match:
        stem = match.group(1)
        side = {"l": "left", "r": "right"}[(match.group(2) or match.group(3)).lower()]
    return re.sub(r"[^a-z0-9]", "", stem.lower()) + side


def apply(host, path, sequence):
    """Keys the weights of a head. Returns the names of tracks that it has no weight for."""
    fps = host.frames_per_second()
    first = host.first_frame()
    by_name = {}
    for node in host.blend_shapes(path):
        for weight in host.weights(node):
            by_name.setdefault(canonical(weight), []).append((node, weight))
    missing = []
    for name, track in sorted(sequence.get("shapes", {}).items()):
        targets = by_name.get(canonical(name)) or [
            target for side in ("left", "right") for target in by_name.get(canonical(name) + side, [])
        ]
        if not targets:
            missing.append(name)
        for node, weight in targets:
            host.set_keys(node, weight, keys(track, fps, first))
    return missing
