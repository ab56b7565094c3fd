"""Messages to `rubor view`: one JSON object a line over a local TCP connection.

{"type": "hello", "version": 1, "from": "maya"}                 first line of a connection
{"type": "weights", "shapes": {"jawOpen": 0.3}, "head": {"yawDegrees": 4.0, "pitchDegrees": 0.0, "rollDegrees": 0.0}}
{"type": "bye"}

Only changed weights are sent; the first message of a connection has all of them.
"""

import json
import math

VERSION = 1
DEFAULT_PORT = 47511


def line(message):
    """A message as bytes with its line end. Refuses what is no number."""
    text = json.dumps(message, separators=(",", ":"), sort_keys=True, allow_nan=False)
    return text.encode("utf-8") + b"\n"


def hello():
    """First message of a connection."""
    return {"type": "hello", "version": VERSION, "from": "maya"}


def bye():
    """Last message of a connection."""
    return {"type": "bye"}


def changed(before, now, least=1e-5):
    """Weights that differ from those sent before by more than `least`; what is gone goes to 0."""
    result = {}
    for name, value in now.items():
        if not math.isfinite(value):
            continue
        if name not in before or abs(before[name] - value) > least:
            result[name] = value
    for name in before:
        if name not in now and before[name] != 0.0:
            result[name] = 0.0
    return result


def head_angles(rows):
    """Yaw, pitch and roll in degrees of Maya's rotation rows: yaw times pitch times roll, roll acts first.

    Scale is taken out. Maya multiplies row vectors, so its rows are the columns of the usual matrix.
    """
    columns = []
    for row in rows:
        length = math.sqrt(sum(c * c for c in row)) or 1.0
        columns.append([c / length for c in row])
    x, y, z = columns
    pitch = math.asin(max(-1.0, min(1.0, -z[1])))
    if abs(z[1]) < 0.999999:
        yaw = math.atan2(z[0], z[2])
        roll = math.atan2(x[1], y[1])
    else:
        # Looking straight up or down, yaw and roll are one turn.
        yaw = math.atan2(-x[2], x[0])
        roll = 0.0
    return {
        "yawDegrees": math.degrees(yaw),
        "pitchDegrees": math.degrees(pitch),
        "rollDegrees": math.degrees(roll),
    }


def weights(shapes, head=None):
    """A change of the face."""
    message = {"type": "weights", "shapes": shapes}
    if head is not None:
        message["head"] = head
    return message
