"""What the cameras under test look at: a controller that a test moves by hand, and a video stream.

The controller speaks just enough RTDE for one reader, written from the protocol's description and
not from the emulator's code: the simulated camera has to work with any controller.
"""

import itertools
import os
import socket
import struct
import threading
import time
from collections import deque
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

TYPES = {"timestamp": "DOUBLE", "actual_q": "VECTOR6D", "actual_TCP_pose": "VECTOR6D",
         "tcp_offset": "VECTOR6D", "actual_digital_output_bits": "UINT64"}
PORT = 30004


class HandMovedController:
    """An RTDE server on a loopback address whose pose and outputs a test sets."""

    numbers = itertools.count(os.getpid())

    def __init__(self, *, missing=()):
        number = next(self.numbers)
        self.address = f"127.99.{number // 250 % 250}.{number % 250 + 2}"
        self.missing = missing
        self.joints, self.pose, self.outputs, self.offset = np.zeros(6), np.zeros(6), 0, np.zeros(6)
        self.silent = False
        self._listener = socket.create_server((self.address, PORT))
        self._closing = threading.Event()
        self._links = []
        threading.Thread(target=self._accept, daemon=True).start()

    def stand(self, base_from_flange, joints=None):
        vector = Rotation.from_matrix(base_from_flange.rotation).as_rotvec()
        self.pose = np.concatenate([base_from_flange.translation / 1000.0, vector])
        self.joints = np.zeros(6) if joints is None else np.asarray(joints)

    def close(self):
        self._closing.set()
        self._listener.close()
        for link in self._links:
            link.close()

    def _accept(self):
        while not self._closing.is_set():
            try:
                link, _ = self._listener.accept()
            except OSError:
                return
            self._links.append(link)
            threading.Thread(target=self._serve, args=(link,), daemon=True).start()

    def _serve(self, link):
        names = []
        try:
            while True:
                kind, content = self._read(link)
                if kind == b"V":
                    self._send(link, b"V", b"\x01")
                elif kind == b"O":
                    names = content[8:].decode().split(",")
                    types = ["NOT_FOUND" if n in self.missing else TYPES[n] for n in names]
                    self._send(link, b"O", b"\x01" + ",".join(types).encode())
                elif kind == b"S":
                    self._send(link, b"S", b"\x01")
                    self._report(link, names)
        except OSError:
            link.close()

    def _report(self, link, names):
        begun = time.monotonic()
        while not self._closing.is_set():
            values = {"timestamp": [time.monotonic() - begun], "actual_q": self.joints,
                      "actual_TCP_pose": self.pose, "tcp_offset": self.offset}
            data = b"\x01"
            for name in names:
                data += (struct.pack(">Q", self.outputs) if name not in values
                         else struct.pack(f">{len(values[name])}d", *values[name]))
            if not self.silent:
                self._send(link, b"U", data)
            time.sleep(0.004)

    @staticmethod
    def _send(link, kind, content):
        link.sendall(struct.pack(">H", 3 + len(content)) + kind + content)

    @staticmethod
    def _read(link):
        header = link.recv(3, socket.MSG_WAITALL)
        if len(header) < 3:
            raise ConnectionError
        size = struct.unpack(">H", header[:2])[0]
        return header[2:], link.recv(size - 3, socket.MSG_WAITALL) if size > 3 else b""


class VideoStream:
    """An MJPEG stream on loopback: a lamp that a test switches, seen `delay` seconds later."""

    def __init__(self, *, size=(320, 240), delay=0.15, period=0.03):
        self.size, self.delay, self.period = size, delay, period
        self.lit, self.frozen = False, False
        stream = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                stream.send(self)

            def log_message(self, *args):
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._ended = False
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def address(self):
        return f"http://127.0.0.1:{self._server.server_port}/stream.mjpg"

    def close(self):
        self._ended = True
        self._server.shutdown()
        self._server.server_close()

    def send(self, handler):
        handler.send_response(200)
        handler.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        handler.end_headers()
        late = deque()
        try:
            while not self._ended:
                if not self.frozen:
                    late.append((time.monotonic(), self._picture()))
                while late and late[0][0] + self.delay < time.monotonic():
                    self._part(handler.wfile, late.popleft()[1])
                time.sleep(self.period)
        except OSError:
            pass

    def _picture(self):
        width, height = self.size
        colour = (60, 120, 200) if self.lit else (10, 20, 30)  # blue, green, red
        return cv2.imencode(".jpg", np.full((height, width, 3), colour, np.uint8))[1].tobytes()

    @staticmethod
    def _part(out, jpeg):
        out.write(b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg))
        out.write(jpeg + b"\r\n")
