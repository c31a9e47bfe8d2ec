"""A witness between masters and a device on Modbus TCP: passes everything on, and notes who writes what and when."""
import socket
import struct
import threading
import time


class Witness:
    """Listens on `port`, and passes each connection on to `to` on loopback (or `host`). `writes`: (time, connection, kind,
    address, value) of each write of one value, by the clock CLOCK_REALTIME [s]; connections count from 1."""

    def __init__(self, port, to, host="127.0.0.1"):
        self.writes, self.to, self.count = [], to, 0
        self.listener = socket.socket()
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listener.bind((host, port))
        self.listener.listen(16)
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            master, _ = self.listener.accept()
            try:
                device = socket.create_connection(("127.0.0.1", self.to), timeout=1)
                device.settimeout(None)
            except OSError:
                master.close()
                continue
            for end in (master, device):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.count += 1
            for source, target, number in ((master, device, self.count), (device, master, None)):
                threading.Thread(target=self.carry, args=(source, target, number), daemon=True).start()

    def carry(self, source, target, connection):
        left = b""
        try:
            while data := source.recv(4096):
                if connection is not None:
                    left = self.look(left + data, connection)
                target.sendall(data)
        except OSError:
            pass
        for end in (source, target):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def look(self, data, connection):
        while len(data) >= 8:
            length = struct.unpack(">H", data[4:6])[0] + 6
            if len(data) < length:
                break
            function = data[7]
            if function in (5, 6) and length >= 12:
                address, value = struct.unpack(">HH", data[8:12])
                self.writes.append((time.time(), connection, "coil" if function == 5 else "holding", address, value))
            data = data[length:]
        return data
