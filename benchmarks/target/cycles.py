"""Instructions and cycles of each step, from QEMU's trace of single instructions.

Cycles after the Cortex-M4 Technical Reference Manual (ARM DDI 0439), tables of chapters 3 and 7, on the
careful side: every load and store takes its full time, every taken branch refills the pipeline (3
cycles beside its own), divisions take their longest. Not in it: wait states of the flash.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

REFILL = 3
_COSTS = (
    (r"vdiv|vsqrt", 14),
    (r"vfma|vfms|vmla|vmls|vnmla|vnmls", 3),
    (r"vldr|vstr", 2),
    (r"sdiv|udiv", 12),
    (r"mla|mls", 2),
    (r"ldrd|strd", 3),
    (r"ldr|str", 2),
    (r"mrs|msr", 2),
)
_LINE = re.compile(r"^\s*([0-9a-f]+):\s+(\S+)\s*(.*)$", re.M)
_SYMBOL = re.compile(r"^([0-9a-f]+) <([^>]+)>:$", re.M)
_TRACE = re.compile(r"\[[0-9a-f]+/([0-9a-f]+)/")


def cost(mnemonic: str, operands: str) -> int:
    """Cycles of an instruction, without the refill of a taken branch."""
    if mnemonic.startswith(("push", "pop", "ldm", "stm", "vpush", "vpop", "vldm", "vstm")):
        return 1 + registers(operands)
    for pattern, cycles in _COSTS:
        if re.match(pattern, mnemonic):
            return cycles + (1 if "d" in operands.split(",")[0] and pattern.startswith("vldr") else 0)
    return 1


def registers(operands: str) -> int:
    """Number of registers in a list, such as {r4-r7, lr}."""
    spans = operands[operands.find("{") + 1 :].rstrip("} ").split(",")
    ends = [[int(number) for number in re.findall(r"\d+", span)] for span in spans]
    return sum(each[1] - each[0] + 1 if len(each) == 2 else 1 for each in ends)


def count_cycles(listing: str, trace: Path) -> tuple[Any, Any]:
    """Instructions and cycles of every call of `one_step`.

    The listing is objdump's; the trace has one line an instruction.
    """
    costs = {int(at, 16): cost(name, operands) for at, name, operands in _LINE.findall(listing)}
    start = {name: int(at, 16) for at, name in _SYMBOL.findall(listing)}["one_step"]
    callers = {int(at, 16) + 4 for at, _, operands in _LINE.findall(listing) if "<one_step>" in operands}
    instructions: list[int] = []
    cycles: list[int] = []
    inside, last = False, 0
    with trace.open(encoding="utf-8") as lines:
        for at in (int(found[1], 16) for line in lines if (found := _TRACE.search(line))):
            if at == start:
                inside = True
                instructions.append(0)
                cycles.append(0)
            inside = inside and at not in callers
            if inside:
                instructions[-1] += 1
                # An instruction is two or four bytes long: farther away, the one before it branched.
                cycles[-1] += costs.get(at, 1) + (REFILL if not 0 <= at - last <= 4 else 0)
            last = at
    return np.array(instructions), np.array(cycles)
