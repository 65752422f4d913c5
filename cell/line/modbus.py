"""The line over Modbus TCP: the cell is the server, the PLC the client."""

from __future__ import annotations

import asyncio
import queue
import threading
from typing import cast

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from cell.core.errors import DeviceError
from cell.core.ports import LineResult, LineStatus, Order, Refusal
from cell.line.handshake import Handshake
from cell.line.registers import FROM_CELL_SIZE, FROM_PLC_SIZE

READ_INPUT = 4


class ModbusLine:
    """A Modbus TCP server in a thread of its own; the registers are those of `registers.py`."""

    def __init__(self, address: str = "127.0.0.1", port: int = 502, patience: float = 3.0) -> None:
        """Prepare to serve on `address`; `patience` s without a heartbeat is a lost line."""
        self._address, self._port = address, port
        self._handshake = Handshake(patience)
        self._loop = asyncio.new_event_loop()
        self._server: ModbusTcpServer | None = None
        self._thread = threading.Thread(target=self._run, name="line", daemon=True)
        self._started: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def open(self) -> None:
        """Begin to listen. Raises `DeviceError` where the address cannot be used."""
        self._thread.start()
        if (failure := self._started.get()) is not None:
            self._thread.join()
            raise DeviceError(f"cannot listen on {self._address}:{self._port}: {failure}",
                              device="line")

    @property
    def endpoint(self) -> tuple[str, int]:
        """Where the server listens, after `open`; the port is a free one where 0 was asked for."""
        assert self._server is not None
        listening = cast(asyncio.Server, self._server.transport)
        address, port = listening.sockets[0].getsockname()[:2]
        return str(address), int(port)

    def show(self, status: LineStatus) -> None:
        """Say what the cell is doing."""
        self._handshake.show(status)

    def take(self, timeout: float) -> Order | None:
        """Wait for the next command of the PLC."""
        return self._handshake.take(timeout)

    def answer(self, order: Order, refusal: Refusal = "") -> None:
        """Echo a command: accepted, or refused and why."""
        self._handshake.answer(order, refusal)

    def publish(self, result: LineResult) -> None:
        """Show a result and hold it until the PLC acknowledges it."""
        self._handshake.publish(result)

    def acknowledged(self, sequence: int) -> bool:
        """Tell whether the PLC has acknowledged the result `sequence`."""
        return self._handshake.acknowledged(sequence)

    def alive(self) -> bool:
        """Tell whether the PLC's heartbeat beats."""
        return self._handshake.alive()

    def close(self) -> None:
        """Stop listening and cut the connections."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(5.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._listen())
            self._started.put(None)
            self._loop.run_forever()
            self._loop.run_until_complete(self._shut_down())
        except OSError as failure:
            self._started.put(failure.strerror or str(failure))
        finally:
            self._loop.close()

    async def _listen(self) -> None:
        holding = SimData(0, count=FROM_PLC_SIZE, datatype=DataType.REGISTERS)
        inputs = SimData(0, count=FROM_CELL_SIZE, datatype=DataType.REGISTERS)
        bits = SimData(0, values=[False] * 16, datatype=DataType.BITS)
        device = SimDevice(0, ([bits], [bits], [holding], [inputs]), action=self._act)
        self._server = ModbusTcpServer(device, address=(self._address, self._port))
        try:
            await self._server.serve_forever(background=True)
        except RuntimeError as failure:
            raise OSError("the address is in use or not allowed") from failure

    async def _shut_down(self) -> None:
        assert self._server is not None
        await self._server.shutdown()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _act(self, function: int, _start: int, address: int, _count: int,
                   registers: list[int],
                   values: list[int] | list[bool] | None) -> ExcCodes | None:
        """Stand between the server and its registers, at every request."""
        if values is not None:
            self._handshake.written(address, [int(value) for value in values])
        elif function == READ_INPUT:
            registers[:FROM_CELL_SIZE] = self._handshake.block()
        return None
