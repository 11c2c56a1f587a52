"""Resets: the one that a step judges, and the one that makes room for a step."""

from cli.commission.bus_session import Bench
from cli.commission.latches import Reset
from cli.commission.operator import Operator
from common import keys
from common.operator import reset_request

AFTER_S = 2.0  # for safety to say that nothing is latched any more
PHRASE = "reset"


def reset(bench: Bench) -> Reset:
    """Request a reset of what is latched now, and return what stayed latched after it."""
    tape = bench.tape
    tape.mark()
    bench.until(lambda: tape.safety, AFTER_S)
    if not tape.safety:
        return Reset(tape.mark(), False, "no state of safety arrives", ())
    request = reset_request(tape.safety[-1].value)
    asked_ns = tape.mark()
    granted, text = bench.call(keys.RESET, request)
    if granted:
        bench.until(lambda: tape.safety and not bench.latched(), AFTER_S)
    else:
        bench.until(lambda: tape.safety, AFTER_S)
    return Reset(asked_ns, granted, text, bench.latched())


def unlatch(bench: Bench, operator: Operator) -> str:
    """Have what is latched reset on the operator's word; return why not, or an empty text."""
    bench.tape.mark()
    bench.until(lambda: bench.tape.safety, AFTER_S)
    if not bench.latched():
        return ""
    fact = f"Safety holds, from before: {', '.join(bench.latched())}. It must be reset first."
    if not operator.confirm(fact, PHRASE):
        return "What safety held from before was not reset."
    done = reset(bench)
    return "" if done.granted and not done.latched else f"The reset was refused: {done.text}"
