"""A line that remembers: orders given beforehand, everything else written down."""

from cell.core.ports import LineResult, LineStatus, Order


class RememberingLine:
    """Hands out `orders` one by one; acknowledges every result at once unless `holding`."""

    def __init__(self, orders=(), holding=False):
        self.orders, self.holding = list(orders), holding
        self.answers, self.results, self.statuses = [], [], []
        self.closed = False

    def open(self) -> None:
        pass

    def show(self, status: LineStatus) -> None:
        if not self.statuses or self.statuses[-1] != status:
            self.statuses.append(status)

    def take(self, timeout: float) -> Order | None:
        return self.orders.pop(0) if self.orders else None

    def answer(self, order: Order, refusal="") -> None:
        self.answers.append((order, refusal))

    def publish(self, result: LineResult) -> None:
        self.results.append(result)

    def acknowledged(self, sequence: int) -> bool:
        return not self.holding

    def alive(self) -> bool:
        return True

    def close(self) -> None:
        self.closed = True
