"""Runs of an exported law under QEMU: its results, its stack, and the instructions that it executes."""

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.codegen.layout import INPUTS, Export
from friction_fmus.codegen.sources import header, implementation, unit_text
from friction_fmus.codegen.vectors import inputs
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import BOOLEANS, LawVariable

COMPILER: Final = "arm-none-eabi-gcc"
EMULATOR: Final = "qemu-arm"
PACKAGES: Final = {COMPILER: "gcc-arm-none-eabi libnewlib-arm-none-eabi", EMULATOR: "qemu-user"}
"""Debian packages of each tool."""

FLAGS: Final = ("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections")
"""Compiler options for the measurement."""

_CPU: Final = "max"  # has all instructions of all cores; some versions of qemu-arm cannot run the M profile


@dataclass(frozen=True)
class Core:
    """A processor core."""

    name: str
    flags: tuple[str, ...]


M0PLUS: Final = Core("Cortex-M0+", ("-mcpu=cortex-m0plus", "-mthumb", "-mfloat-abi=soft"))
M4F: Final = Core("Cortex-M4F", ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"))
M7: Final = Core("Cortex-M7", ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"))

CORES: Final = (M0PLUS, M4F, M7)
"""Without floating-point unit, with one for float, and with one for double."""


def missing() -> list[str]:
    """Return the tools that are not installed."""
    return [tool for tool in PACKAGES if not shutil.which(tool)]


def call(folder: Path, *command: str) -> str:
    """Run a tool in a folder and return its output."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason: Sequence[str] = done.stderr.strip().splitlines()[:1] or [f"status {done.returncode}"]
        raise FrictionError(f"{command[0]} failed: {reason[0]}")
    return done.stdout


def compile_law(export: Export, core: Core, folder: Path, *flags: str) -> None:
    """Write the files of a law and compile ``PREFIX.o``."""
    p = export.prefix
    (folder / f"{p}.h").write_text(header(export), encoding="utf-8")
    (folder / f"{p}.c").write_text(implementation(export), encoding="utf-8")
    call(folder, COMPILER, *core.flags, *FLAGS, *flags, "-c", f"{p}.c")


def link_program(export: Export, core: Core, folder: Path, text: str, *flags: str) -> None:
    """Compile a C program with the entry ``start`` and link it with the law of `compile_law` as ``program``."""
    (folder / "program.c").write_text(text, encoding="utf-8")
    # shrink-wrapping would read the stack pointer before the registers are saved
    link = ("-fno-shrink-wrap", "-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections", "-Wl,-e,start")
    sources = ("program.c", f"{export.prefix}.o", "-lm", "-o", "program")
    call(folder, COMPILER, *core.flags, *FLAGS, *flags, *link, *sources)


def emulate(folder: Path, *flags: str) -> str:
    """Run ``program`` under QEMU and return its output."""
    return call(folder, EMULATOR, "-cpu", _CPU, *flags, "./program")


# A program that runs an exported law with given samples under qemu-arm, in place of the microcontroller.
#
# It needs no C runtime and writes its results by Linux system calls. The counted instructions belong to the law and to
# the library functions that it calls; they are the same on every core with this instruction set.

_SIZES = {"m": 1e-3, "m/s": 1e-2, "m/s2": 1.0, "rad": 1e-3, "rad/s": 1e-2}
"""Magnitude of the samples by unit, for which friction and control are neither at rest nor saturated."""

STACK = 4096  # size of the monitored stack [bytes]


def samples(export: Export, n: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Return n random samples of the inputs around their start values, with some zeros; Booleans rarely change."""
    random = np.random.default_rng(seed)

    def draw(variable: LawVariable) -> np.ndarray:
        start = export.start[variable.name][0]
        if variable.kind in BOOLEANS:
            return np.where(random.random(n) < 0.1, 1.0 - start, start)
        column = start + _SIZES.get(unit_text(variable), 1.0) * random.normal(size=n)
        column[random.random(n) < 0.1] = 0.0
        return column.astype(np.float32).astype(float) if export.real.suffix else column

    return {variable.name: draw(variable) for variable in export.law.select(*INPUTS)}


def program(export: Export, given: Mapping[str, np.ndarray], restart: int = 0) -> str:
    """Return the text of the program."""
    # For every sample, the program writes a line with the bytes of the results and of the lower parts of pairs, and at
    # the end the depth of the stack [bytes]. With the macro QUIET it runs the law once and writes only that depth.
    p, inputs = export.prefix, export.law.select(*INPUTS)
    n = len(next(iter(given.values()))) if given else 1
    cells = [cell for v in inputs for cell in _cells(export, v, given[v.name])]
    rows = [f"    {{{', '.join(row)}}}," for row in zip(*(column for _, column in cells), strict=True)]
    shown = [place.replace("->", ".") for place in (*export.results, *export.result_lows.values())]
    write = [
        line for place in shown for line in (f"            value = {place};", "            hex(&value, sizeof value);")
    ]
    return "\n".join(
        [
            f'#include "{p}.h"',
            "",
            f"static const {export.real.name} given[{n}][{max(len(cells), 1)}] = {{",
            *(rows or ["    {0},"]),
            "};",
            CALLS,
            *(f"static {p}_{group} {group};" for group in export.groups),
            "",
            "static volatile unsigned char *stack; /* of the step */",
            "",
            "static void __attribute__((noinline, noclone)) run(unsigned n, int writes)",
            "{",
            "    unsigned k;",
            f"    {export.real.name} value;",
            '    __asm__ volatile("mov %0, sp" : "=r"(stack));',
            "    for (k = 0; k < n; k++) {",
            f"        if (k == 0 || k == {restart})",
            f"            {p}_init(&parameters, &states, &inputs, &outputs);",
            *(f"        {assignment % i}" for i, (assignment, _) in enumerate(cells)),
            f"        {p}_step(&parameters, &states, &inputs, &outputs);",
            "        if (writes) {",
            *write,
            '            linux(4, 1, "\\n", 1);',
            "        }",
            "    }",
            "}",
            "",
            "void start(void);",
            "void start(void)",
            "{",
            "    unsigned depth;",
            "    run(0, 0);",
            f"    for (depth = 1; depth <= {STACK}; depth++)",
            "        *(stack - depth) = 0xA5;",
            f"    run({n}, 0);",
            f"    for (depth = {STACK}; depth > 0 && *(stack - depth) == 0xA5; depth--)",
            "        ;",
            "#ifndef QUIET",
            f"    run({n}, 1);",
            "#endif",
            "    hex(&depth, sizeof depth);",
            "    linux(1, 0, 0, 0);",
            "}",
            "",
        ]
    )


def _cells(export: Export, variable: LawVariable, values: np.ndarray) -> list[tuple[str, list[str]]]:
    """Return the assignment of column %d to each member of an input, and the samples of this member."""
    name, columns = variable.name, {variable.name: values}
    if name in export.pairs:
        high = values.astype(np.float32).astype(float)
        columns = {name: high, f"{name}_low": values - high}
    test = " != 0" if variable.kind in BOOLEANS else ""
    return [
        (f"inputs.{member} = given[k][%d]{test};", [export.real.literal(float(value)) for value in part])
        for member, part in columns.items()
    ]


CALLS = """
static void linux(long number, long a, const void *b, long c)
{
    register long r7 __asm__("r7") = number;
    register long r0 __asm__("r0") = a;
    register const void *r1 __asm__("r1") = b;
    register long r2 __asm__("r2") = c;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r7), "r"(r1), "r"(r2) : "memory");
}

static void hex(const void *bytes, unsigned n)
{
    const unsigned char *byte = bytes;
    char text[2];
    for (unsigned i = 0; i < n; i++) {
        text[0] = "0123456789abcdef"[byte[i] >> 4];
        text[1] = "0123456789abcdef"[byte[i] & 15];
        linux(4, 1, text, 2);
    }
    linux(4, 1, " ", 1);
}
"""

RANDOM = 50  # number of counted samples with random inputs, before the samples of the unit test

_LOG = re.compile(rb"^(?:Trace \d+: \S+ \[[0-9a-f]+/([0-9a-f]+)/|0x([0-9a-f]+): |(IN):)", re.M)


@dataclass(frozen=True)
class Instruction:
    """An instruction of a program."""

    size: int  # size [bytes]
    text: str  # mnemonic, tab and operands as objdump prints them
    function: str  # the function that contains it


@dataclass(frozen=True)
class Trace:
    """The instructions that a program executes in steps of the law, from entry to return."""

    code: Mapping[int, Instruction]  # instructions of the program by address
    blocks: tuple[tuple[int, ...], ...]  # instructions of blocks that are executed from the first to the last
    steps: tuple[tuple[int, ...], ...]  # blocks of each step: `RANDOM` with random inputs, then the unit test
    stack: int  # depth of the stack below the caller of the law [bytes]

    @property
    def counts(self) -> list[int]:
        """Number of instructions of each step."""
        sizes = [len(block) for block in self.blocks]
        return [sum(sizes[i] for i in step) for step in self.steps]

    @property
    def executed(self) -> set[int]:
        """Addresses of all executed instructions."""
        return {address for i in {i for step in self.steps for i in step} for address in self.blocks[i]}


def trace(export: Export, core: Core, folder: Path) -> Trace:
    """Run a law that `compile_law` compiled in a folder, and return the instructions that it executes."""
    random, test = samples(export, RANDOM), inputs(export)
    given = {name: np.append(column, test[name]) for name, column in random.items()}
    link_program(export, core, folder, program(export, given, restart=RANDOM), "-DQUIET")
    depth = emulate(folder, "-d", "in_asm,exec,nochain", "-D", "log")
    code = _disassembled(folder)
    entry = next(address for address, at in code.items() if at.function == f"{export.prefix}_step")
    blocks, steps = _steps((folder / "log").read_bytes(), code, entry)
    count = max((len(column) for column in given.values()), default=1)
    if len(steps) != count:
        raise FrictionError(f"{EMULATOR} logged {len(steps)} steps of {export.law.name} instead of {count}")
    return Trace(code, blocks, steps, int.from_bytes(bytes.fromhex(depth), "little"))


def _steps(
    log: bytes, code: Mapping[int, Instruction], entry: int
) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Return the blocks of instructions and, for each step, the indices of its blocks."""
    blocks: list[tuple[int, ...]] = []
    index: dict[bytes, int] = {}  # of the block last translated, by its address
    listed: list[bytes] = []
    steps: list[list[int]] = []
    home, last = -1, -1
    starts: list[int] = []
    for executed, translated, begin in _LOG.findall(log):
        if begin:
            listed = []
        elif translated:
            listed.append(translated)
        else:
            if listed:
                index[executed] = len(blocks)
                blocks.append(_between(code, int(listed[0], 16), int(listed[-1], 16)))
                starts.append(blocks[-1][0])
                listed = []
            if executed not in index:
                raise FrictionError(
                    f"{EMULATOR} logged no instructions at 0x{executed.decode()}; install another version"
                )
            here = index[executed]
            if starts[here] == entry:
                home = blocks[last][-1] + 4  # the call is a BL with four bytes
                steps.append([])
            elif starts[here] == home:
                home = -1
            if home != -1:
                steps[-1].append(here)
            last = here
    return tuple(blocks), tuple(map(tuple, steps))


def _between(code: Mapping[int, Instruction], first: int, last: int) -> tuple[int, ...]:
    """Return the addresses of the instructions from one to the other."""
    # QEMU's own list is no substitute: its disassembler reads the code in pieces, and may show the second half of an
    # instruction as another one.
    found = [first]
    while (following := found[-1] + code[found[-1]].size) <= last:
        found.append(following)
    return tuple(found)


def _disassembled(folder: Path) -> dict[int, Instruction]:
    """Return the instructions of ``program`` by address."""
    found, function = {}, ""
    row = re.compile(r"\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(.*)")
    for line in call(folder, "arm-none-eabi-objdump", "-d", "program").splitlines():
        if line.endswith(">:"):
            function = line.split("<")[1].removesuffix(">:")
        elif match := row.fullmatch(line):
            found[int(match[1], 16)] = Instruction(len(match[2].replace(" ", "")) // 2, match[3], function)
    return found
