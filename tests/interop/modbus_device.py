"""A Modbus TCP device on pymodbus with units 1 and 2, for our client to talk to; other units stay silent.

usage: modbus_device.py PORT   (0 picks a free one). Prints the port, then for every line on stdin one JSON line of
what unit 1 and 2 hold by now. Ends at the end of stdin.
"""
import asyncio
import json
import sys
import threading

from pymodbus.constants import Endian
from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.payload import BinaryPayloadBuilder
from pymodbus.server.async_io import ModbusTcpServer


def words(value, kind, byteorder, wordorder):
    builder = BinaryPayloadBuilder(byteorder=byteorder, wordorder=wordorder)
    getattr(builder, "add_" + kind)(value)
    return builder.to_registers()


def unit(number):
    inputs = [0] * 20
    inputs[0:2] = words(30.125 + number, "32bit_float", Endian.Big, Endian.Big)
    inputs[2:3] = words(-1234, "16bit_int", Endian.Big, Endian.Big)
    inputs[10:12] = words(4000000000, "32bit_uint", Endian.Big, Endian.Little)
    inputs[12:13] = [0b1000_0000_0000_0100]
    return ModbusSlaveContext(
        di=ModbusSequentialDataBlock(0, [0, 0, 1, 0]),
        co=ModbusSequentialDataBlock(0, [0] * 4),
        hr=ModbusSequentialDataBlock(0, [0] * 20),
        ir=ModbusSequentialDataBlock(0, inputs),
        zero_mode=True,
    )


async def serve(port):
    units = {number: unit(number) for number in (1, 2)}
    server = ModbusTcpServer(
        ModbusServerContext(slaves=units, single=False),
        address=("127.0.0.1", port),
        allow_reuse_address=True,
        ignore_missing_slaves=True,
    )
    task = asyncio.ensure_future(server.serve_forever())
    await server.serving
    print(server.server.sockets[0].getsockname()[1], flush=True)

    def answer_questions():
        for _ in sys.stdin:
            state = {str(n): {"holding": u.getValues(3, 0, 10), "coils": [bool(c) for c in u.getValues(1, 0, 2)]} for n, u in units.items()}
            print(json.dumps(state), flush=True)
        loop.call_soon_threadsafe(task.cancel)

    loop = asyncio.get_running_loop()
    threading.Thread(target=answer_questions, daemon=True).start()
    try:
        await task
    except asyncio.CancelledError:
        pass


asyncio.run(serve(int(sys.argv[1])))
