"""Sends the weights of a head to a viewer on this machine while the artist works: `rubor view HEAD --live`."""

import socket

from . import messages


class LiveLink:
    """A connection that sends what changed. Never raises into Maya: a lost viewer only ends the link."""

    def __init__(self, host, path, port=messages.DEFAULT_PORT, connect=None):
        self.host = host
        self.path = path
        self.sent = {}
        self.sent_head = None
        self.handle = None
        # Only this machine: weights of an unreleased character do not belong on a network.
        self.socket = (connect or _connect)(("127.0.0.1", port))
        self._send(messages.hello())

    def start(self):
        """Sends now and after every change."""
        self.update()
        if self.socket is not None:
            self.handle = self.host.on_change(self.update)

    def update(self, *_):
        """Sends what differs from the last message."""
        if self.socket is None:
            return
        now = {}
        for node in self.host.blend_shapes(self.path):
            for name, value in self.host.weights(node).items():
                # Face, teeth and lashes have weights of one name; where they differ, the strongest shows.
                if abs(value) >= abs(now.get(name, 0.0)):
                    now[name] = value
        shapes = messages.changed(self.sent, now)
        head = messages.head_angles(self.host.rotation_degrees(self.path))
        moved = self.sent_head is None or any(abs(head[k] - self.sent_head[k]) > 1e-4 for k in head)
        if not shapes and not moved:
            return
        if self._send(messages.weights(shapes, head if moved else None)):
            self.sent.update(shapes)
            self.sent_head = head

    def stop(self):
        """Ends the link."""
        if self.handle is not None:
            self.host.stop(self.handle)
            self.handle = None
        if self.socket is not None:
            self._send(messages.bye())
        if self.socket is not None:
            self.socket.close()
            self.socket = None

    def _send(self, message):
        try:
            self.socket.sendall(messages.line(message))
            return True
        except OSError as error:
            self.socket.close()
            self.socket = None
            self.host.say("the viewer is gone ({})".format(error))
            self.stop()
            return False


def _connect(address):
    connection = socket.create_connection(address, timeout=1.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection
