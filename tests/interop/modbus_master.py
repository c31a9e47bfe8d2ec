"""A Modbus TCP master on pymodbus, against our simulated heater: prints what it reads as one JSON line, then writes.

usage: modbus_master.py PORT
"""
import json
import sys

from pymodbus.client import ModbusTcpClient
from pymodbus.constants import Endian
from pymodbus.payload import BinaryPayloadDecoder

client = ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]))
assert client.connect()
inputs = client.read_input_registers(0, 11, slave=1)
decoder = BinaryPayloadDecoder.fromRegisters(inputs.registers, byteorder=Endian.Big, wordorder=Endian.Big)
result = {
    "slide_resistance": decoder.decode_32bit_uint(),
    "base_resistance": decoder.decode_32bit_uint(),
    "slide_temperature": decoder.decode_32bit_float(),
    "base_temperature": decoder.decode_32bit_float(),
    "pad_temperature": decoder.decode_16bit_int(),
    "delivered_power": decoder.decode_16bit_uint(),
    "status": decoder.decode_16bit_uint(),
    "coils": client.read_coils(0, 2, slave=1).bits[:2],
    "beyond": client.read_holding_registers(100, 1, slave=1).exception_code,
    "above_range": client.write_register(0, 20001, slave=1).exception_code,
    "other_unit": client.read_holding_registers(0, 1, slave=9).exception_code,
}
client.write_register(1, 1, slave=1)  # the heartbeat
client.write_registers(0, [1234], slave=1)
client.write_coil(0, True, slave=1)
result["power_read_back"] = client.read_holding_registers(0, 1, slave=1).registers[0]
print(json.dumps(result))
client.close()
