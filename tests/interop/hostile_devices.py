"""Heater controllers that misbehave, one a port, on pymodbus: it decodes the requests and keeps the registers, and what goes over the
wire is spoiled here.

usage: hostile_devices.py. Prints one JSON line {name: [port, whether its readings can be taken (null: now and then), words of its notice]},
then for every line on stdin one of {name: [highest power that was written, requests]}. Ends at the end of stdin.
"""
import asyncio
import json
import logging
import socket
import struct
import sys
import threading

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusSlaveContext
from pymodbus.factory import ServerDecoder

logging.disable(logging.CRITICAL)
RESISTANCE = 1_000_000  # 1000 ohm in counts: 25 degC


class Device:
    """Registers as deployment/maps/heater.yaml says, and one way to misbehave."""

    def __init__(self, spoil):
        inputs = [RESISTANCE >> 16, RESISTANCE & 0xFFFF] * 2 + [0x41C8, 0] * 2 + [2500, 0, 1] + [0] * 9
        self.store = ModbusSlaveContext(
            di=ModbusSequentialDataBlock(0, [0] * 8),
            co=ModbusSequentialDataBlock(0, [0] * 8),
            hr=ModbusSequentialDataBlock(0, [0, 0, 1000, 800] + [0] * 8),
            ir=ModbusSequentialDataBlock(0, inputs),
            zero_mode=True,
        )
        self.spoil = spoil
        self.highest_power = 0
        self.requests = 0
        self.connections = 0

    def carry_out(self, pdu):
        answer = ServerDecoder().decode(pdu).execute(self.store)
        self.highest_power = max(self.highest_power, self.store.getValues(3, 0, 1)[0])
        return bytes([answer.function_code]) + answer.encode()

    async def serve(self, reader, writer):
        self.connections += 1
        number = 0
        try:
            while True:
                head = await reader.readexactly(7)
                transaction, _, length, unit = struct.unpack(">HHHB", head)
                pdu = await reader.readexactly(length - 1)
                self.requests += 1
                number += 1
                talk = Talk(self, reader, writer, transaction, unit, pdu, number)
                await self.spoil(talk)
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            self.connections -= 1
            writer.close()


class Talk:
    def __init__(self, device, reader, writer, transaction, unit, pdu, number):
        self.device, self.reader, self.writer = device, reader, writer
        self.transaction, self.unit, self.pdu, self.number = transaction, unit, pdu, number
        self.is_write = pdu[0] > 4

    def honest(self):
        return self.framed(self.device.carry_out(self.pdu))

    def exception(self, code):
        return self.framed(bytes([self.pdu[0] | 0x80, code]))

    def framed(self, pdu, transaction=None, protocol=0, more=0, unit=None):
        transaction = self.transaction if transaction is None else transaction
        return struct.pack(">HHHB", transaction & 0xFFFF, protocol, len(pdu) + 1 + more, self.unit if unit is None else unit) + pdu

    def send(self, answer):
        self.writer.write(answer)

    def close(self):
        self.writer.close()
        raise ConnectionResetError

    def reset(self):
        self.writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close()


def changed(at, to):
    """A sound answer with one byte changed."""

    def make(talk):
        answer = bytearray(talk.honest())
        answer[at] = to(answer[at]) & 0xFF
        return bytes(answer)

    return make


def answers(make):
    async def spoil(talk):
        talk.send(make(talk))

    return spoil


def each(n, make):
    """Every n-th answer so, the others sound."""

    async def spoil(talk):
        talk.send(make(talk) if talk.device.requests % n == 0 else talk.honest())

    return spoil


async def closes(talk):
    talk.send(talk.honest())
    await talk.writer.drain()
    talk.close()


async def trickles(talk, pause=0.005):
    for byte in talk.honest():
        await asyncio.sleep(pause)
        talk.send(bytes([byte]))
        await talk.writer.drain()


async def too_slow(talk):
    await trickles(talk, 0.3)


async def two_segments(talk):
    answer = talk.honest()
    talk.send(answer[:5])
    await talk.writer.drain()
    await asyncio.sleep(0.02)
    talk.send(answer[5:])


async def late(talk):
    if talk.device.requests % 9 == 0:
        await asyncio.sleep(2.5)
    talk.send(talk.honest())


async def silent_now_and_then(talk):
    if talk.device.requests % 9:
        talk.send(talk.honest())


async def silent(talk):
    pass


async def resets_now_and_then(talk):
    if talk.device.requests % 9 == 0:
        talk.reset()
    talk.send(talk.honest())


async def resets_within_an_answer(talk):
    answer = talk.honest()
    if talk.device.requests % 9 == 0:
        talk.send(answer[:8])
        await talk.writer.drain()
        talk.reset()
    talk.send(answer)


async def closes_at_once(talk):
    talk.close()


async def closes_when_idle(talk):
    talk.send(talk.honest())
    await talk.writer.drain()
    await asyncio.sleep(0.03)
    if talk.number % 5 == 0:
        talk.close()


async def one_connection(talk):
    if talk.device.connections > 1:
        talk.close()
    talk.send(talk.honest())


async def single_functions_unknown(talk):
    talk.send(talk.exception(1) if talk.pdu[0] in (5, 6) else talk.honest())


async def four_registers(talk):
    too_many = talk.pdu[0] in (3, 4) and talk.pdu[4] > 4
    talk.send(talk.exception(3) if too_many else talk.honest())


async def refuses_writes(talk):
    talk.send(talk.exception(3) if talk.is_write and talk.pdu[2] == 0 else talk.honest())


async def floods(talk):
    for _ in range(200):
        talk.send(bytes(1000))
        await talk.writer.drain()


def shows(words):
    async def spoil(talk):
        talk.device.store.setValues(4, 0, words)
        talk.send(talk.honest())

    return spoil


def both(first, second):
    return lambda talk: first(talk) + second(talk)


unit, function = changed(6, lambda b: b + 1), changed(7, lambda b: b ^ 7)
protocol, length = changed(3, lambda b: 1), changed(5, lambda b: b + 2)
short_length, count = changed(5, lambda b: b - 1), changed(8, lambda b: b + 1)
foreign = changed(0, lambda b: b ^ 0x40)
honest, half = Talk.honest, lambda talk: talk.honest()[:6]
# name: how it misbehaves, whether its readings can be taken (null: now and then), words of the notice that must come (none: "")
DEVICES = {
    "honest": (answers(honest), True, ""),
    "closes after each answer": (closes, True, "closes the connection after each answer"),
    "closes when idle": (closes_when_idle, True, ""),
    "a byte each 5 ms": (trickles, True, ""),
    "busy now and then (5)": (each(3, lambda t: t.honest() if t.is_write else t.exception(5)), True, "is busy"),
    "busy now and then (6)": (each(3, lambda t: t.exception(6)), True, "is busy"),
    "two segments": (two_segments, True, ""),
    "each answer twice": (answers(lambda t: t.honest() * 2 if not t.is_write else t.honest()), True, ""),
    "checksum behind": (answers(lambda t: t.honest() + b"\xca\xfe"), True, "sends bytes that answer nothing"),
    "late now and then": (late, True, ""),
    "silent now and then": (silent_now_and_then, True, ""),
    "resets now and then": (resets_now_and_then, True, ""),
    "resets within an answer": (resets_within_an_answer, True, ""),
    "wrong unit now and then": (each(9, unit), True, ""),
    "wrong protocol now and then": (each(9, protocol), True, ""),
    "wrong length now and then": (each(9, length), True, ""),
    "wrong function now and then": (each(9, function), True, ""),
    "wrong count now and then": (each(9, count), True, ""),
    "foreign transaction now and then": (each(9, foreign), True, ""),
    "gateway deaf now and then": (each(9, lambda t: t.exception(11)), True, ""),
    "one connection": (one_connection, True, ""),
    "functions 5 and 6 unknown": (single_functions_unknown, True, ""),
    "four registers a read": (four_registers, True, "refuses reads of several registers"),
    "silent": (silent, False, "no answer within"),
    "closes at once": (closes_at_once, False, "closes the connection instead of an answer"),
    "wrong unit": (answers(unit), False, "wrong in their unit"),
    "unit 255": (answers(changed(6, lambda b: 255)), False, "wrong in their unit"),
    "wrong protocol": (answers(protocol), False, "wrong in their protocol"),
    "length too long": (answers(length), False, ""),
    "length too short": (answers(short_length), False, "wrong in their length"),
    "wrong function": (answers(function), False, "wrong in their function"),
    "wrong count": (each(1, lambda t: t.honest() if t.is_write else count(t)), False, "wrong in their byte count"),
    "foreign transaction": (answers(foreign), False, "wrong in their transaction"),
    "wrong echo": (each(1, lambda t: changed(11, lambda b: b ^ 1)(t) if t.is_write else t.honest()), None, "wrong in their echo"),
    "exception 1": (answers(lambda t: t.exception(1)), False, "exception 1"),
    "exception 2": (answers(lambda t: t.exception(2)), False, "exception 2"),
    "exception 4": (answers(lambda t: t.exception(4)), False, "exception 4"),
    "always busy": (answers(lambda t: t.exception(6)), False, "it is busy"),
    "no path": (answers(lambda t: t.exception(10)), False, "the gateway has no path"),
    "gateway deaf": (answers(lambda t: t.exception(11)), False, "the gateway hears nothing"),
    "half of each answer": (answers(half), False, ""),
    "answers as a web server": (answers(lambda t: b"HTTP/1.1 400 Bad Request\r\n\r\n"), False, "wrong in their protocol"),
    "garbage": (answers(lambda t: bytes(b ^ 0x5A for b in t.honest())), False, "wrong in their protocol"),
    "floods": (floods, False, ""),
    "a byte each 300 ms": (too_slow, False, ""),
    "beyond the range": (shows([0xFFFF, 0xFFFF]), False, "outside its range"),
    "no resistance": (shows([0, 0]), False, "open or short"),
    "refuses writes of power": (refuses_writes, False, "does not take"),
}


async def main():
    devices, servers, table = {}, [], {}
    for name, (spoil, comes, said) in DEVICES.items():
        devices[name] = Device(spoil)
        servers.append(await asyncio.start_server(devices[name].serve, "127.0.0.1", 0))
        table[name] = [servers[-1].sockets[0].getsockname()[1], comes, said]
    print(json.dumps(table), flush=True)
    loop, end = asyncio.get_running_loop(), asyncio.Event()

    def answer_questions():
        for _ in sys.stdin:
            print(json.dumps({name: [d.highest_power, d.requests] for name, d in devices.items()}), flush=True)
        loop.call_soon_threadsafe(end.set)

    threading.Thread(target=answer_questions, daemon=True).start()
    await end.wait()


asyncio.run(main())
