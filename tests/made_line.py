"""A line that remembers: orders given beforehand, everything else written down."""

from dataclasses import dataclass

from cell.core.ports import LineResult, LineStatus, Order

STOP, RESET, ABORT = Order("stop"), Order("reset", operator="Meier"), Order("abort")


def start(body, body_type=1, **changes):
    return Order("start", body, body_type, **changes)


@dataclass(frozen=True)
class When:
    """An order that is given as soon as the cell shows `state`, with `hole` holes done or more."""

    state: str
    order: Order
    hole: int = 0

    def is_now(self, status: LineStatus) -> bool:
        return status.state == self.state and status.hole >= self.hole


class RememberingLine:
    """Gives its orders one by one: a start or a stop when the cell is ready for one, a reset or an
    abort when it stands in a fault, others at once. Acknowledges a result after `patience` looks.
    """

    def __init__(self, orders=(), patience=0):
        self.orders, self.patience = list(orders), patience
        self.answers, self.results, self.statuses = [], [], [LineStatus("starting")]
        self.asked = 0

    def open(self) -> None:
        pass

    def show(self, status: LineStatus) -> None:
        if self.statuses[-1] != status:
            self.statuses.append(status)

    def take(self, timeout: float) -> Order | None:
        if not self.orders or not self._is_now(self.orders[0]):
            return None
        order = self.orders.pop(0)
        return order.order if isinstance(order, When) else order

    def _is_now(self, order):
        status = self.statuses[-1]
        if isinstance(order, When):
            return order.is_now(status)
        if order.command in ("start", "stop"):
            return status.ready or status.master_due
        return bool(status.fault) or order.command not in ("reset", "abort")

    def answer(self, order: Order, refusal="") -> None:
        self.answers.append((order, refusal))

    def publish(self, result: LineResult) -> None:
        self.results.append(result)
        self.asked = 0

    def acknowledged(self, sequence: int) -> bool:
        self.asked += 1
        return self.asked > self.patience

    def alive(self) -> bool:
        return True

    def close(self) -> None:
        pass
