"""A person in the PLC's place: what is typed, and that two sources of orders do not mix."""

import pytest
from made_line import RememberingLine, When

from cell.core.ports import LineResult, Order
from cell.line.manual import Keyboard, LineWithKeyboard, ManualLine, parse_order


@pytest.mark.parametrize(("typed", "order"), [
    ("s 3 WVW 17\n", Order("start", body_id="WVW 17", body_type=3)),
    ("b Meier window broken", Order("bypass", operator="Meier", reason="window broken")),
    ("r Meier", Order("reset", operator="Meier")),
    ("e Meier", Order("end_bypass", operator="Meier")),
    ("a", Order("abort")), ("q", Order("stop")),
    ("s three WVW", None), ("s 3", None), ("b Meier", None), ("r", None), ("", None), ("x", None)])
def test_an_order_is_understood_or_not_taken(typed, order):
    assert parse_order(typed) == order


def test_a_result_is_told_and_waits_for_its_acknowledgement():
    said = []
    keyboard = Keyboard(["s 1 B7", "nonsense"], said.append)
    line = ManualLine(keyboard, said.append)
    line.open()
    order = line.take(5.0)
    line.answer(order, "unknown_type")
    line.publish(LineResult(5, "B7", 1, "nok", 3, 1, 0, 0.9))
    assert not line.acknowledged(5)
    keyboard.acknowledge.set()
    assert line.acknowledged(5) and not line.acknowledged(4)
    assert any("NOK" in text for text in said) and any("unknown type" in text for text in said)


def test_orders_of_the_keyboard_are_not_echoed_to_the_plc():
    plc_order = Order("start", "B1", 1)
    other = RememberingLine([When("starting", plc_order)])
    line = LineWithKeyboard(other, Keyboard(["r Meier"], lambda text: None))
    line.open()
    taken = []
    while len(taken) < 2:
        if (order := line.take(0.05)) is not None:
            line.answer(order)
            taken.append(order.command)
    assert set(taken) == {"reset", "start"} and other.answers == [(plc_order, "")]
