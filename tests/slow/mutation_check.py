"""Whether README's test command finds mistakes in C: mutants of ``fmu_src`` and of ``harness/engine`` and ``masters``.

    python tests/slow/mutation_check.py [COUNT] [--first N] [--seed SEED] [--measured FILE] [--seconds S]

A mutant has one sign, comparison or constant changed, or one statement dropped. Those that do not compile are replaced
by others. All tests run once without a mutant, which tells the FMUs and libraries that each test file opens and its
processor time; ``--measured`` keeps that in a file and uses it if it exists. For each mutant run first the files that
open what it is compiled into, beginning with short ones for it and with those that found others in the same C file;
only if they pass, all others run. With ``--seconds``, only the former run, as many as take that processor time. A
mutant is found too if the tests take five times as long with it. Survivors that are not in `EQUIVALENT` are printed;
the status is 1 if fewer than 95 % are found.

FMUs are built without figures, see ``quick.py``, and kept for all mutants.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
OTHERS = {
    **{" + ": " - ", " - ": " + ", " * ": " / ", " / ": " * ", "-= ": "+= ", "+= ": "-= "},
    **{" < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ", " == ": " != ", " != ": " == "},
    **{" && ": " || ", " || ": " && "},
}
EQUIVALENT = {
    'fmu_src/composite/composite.h: REQUIRE(size >= SAVED_SIZE, "fmi2DeSerializeFMUstate: %u bytes were given, '
    'but a state of this FMU has more",  ->  REQUIRE(size > SAVED_SIZE, "fmi2DeSerializeFMUstate: %u bytes were '
    'given, but a state of this FMU has more",': ("a state without its parts is an error either way"),
    "fmu_src/composite/composite.h: const int64_t part = INPUT_PART < 0 ? 0 : INPUT_PART;  ->  const int64_t part = "
    "INPUT_PART <= 0 ? 0 : INPUT_PART;": ("the part of number 0 is 0 either way"),
    "fmu_src/composite/composite.h: p->direct = data->functions->direct ? data->functions->direct() : NULL;  ->  "
    "dropped": ("without direct calls a composite takes longer"),
    "fmu_src/composite/composite.h: if (size - end < sizeof inner)  ->  if (size - end <= sizeof inner)": (
        "no part has a state without bytes"
    ),
    "fmu_src/composite/composite.h: bool good = m->solved >= 0.0 && m->solved <= fmax(m->spent, 0.0) + slack && "
    "is_bit(m->exchange) &&  ->  bool good = m->solved >= 0.0 && m->solved < fmax(m->spent, 0.0) + slack && "
    "is_bit(m->exchange) &&": ("a state exactly at the end of the slack"),
    "fmu_src/composite/composite.h: isfinite(m->time) && fabs(m->spent) <= 1.001 * STEP_SIZE && m->drift >= 0.0 && "
    "m->drift < INFINITY &&  ->  isfinite(m->time) && fabs(m->spent) <= (1.05 * 1.001) * STEP_SIZE && m->drift >= "
    "0.0 && m->drift < INFINITY &&": ("a run is never between the two bounds"),
    'fmu_src/fmi2.h: c->name, t, bad < INPUTS ? c->row_of[inputs[bad]]->name : "an input");  ->  c->name, t, '
    'bad <= INPUTS ? c->row_of[inputs[bad]]->name : "an input");': ("one input is not finite where there is a fault"),
    "fmu_src/fmi3/fmi3_values.h: const int size = values[i] < INT32_MAX ? (int)values[i] : INT32_MAX;  ->  "
    "const int size = values[i] <= INT32_MAX ? (int)values[i] : INT32_MAX;": ("the bound is itself"),
    "fmu_src/friction/BurridgeKnopoff.c: s = done < h - s ? s + done : h;  ->  s = done < h + s ? s + done : h;": (
        "up to a last piece as short as a rounding error"
    ),
    "fmu_src/friction/ElastoPlastic.c: double part = fmin(p, 1.0 / y), power = 1.0, term = 1.0, before = 1.0,"
    " earlier;  ->  double part = fmin(p, 1.0 / y), power = 1.0, term = (1.05 * 1.0), before = 1.0, earlier;": (
        "any size that is not negligible stands for terms before the first one"
    ),
    "fmu_src/friction/GMS.c: if (m->memory.slips[i] != 0.0 || force >= level * level_at(m, 0.0)) {  ->  if "
    "(m->memory.slips[i] != 0.0 || force > level * level_at(m, 0.0)) {": (
        "the search finds an element at its level at once, too"
    ),
    "fmu_src/friction/GMS.c: width *= 2.0;  ->  dropped": ("more work behind a near miss, as intervals stay short"),
    "fmu_src/friction/GenericAsperity.c: if (A > 0.0 && !(N * fabs(mean) * h <= 2.0 * MOST_TRIES * "
    "wavelength))  ->  if (A > 0.0 && !(N * fabs(mean) * h <= (1.05 * 2.0) * MOST_TRIES * wavelength))": (
        "how much work is refused"
    ),
    "fmu_src/friction/KarnoppMass.c: if (until < wait) {  ->  if (until <= wait) {": (
        "the force exceeds static friction in both directions at the same time only if it never does"
    ),
    "fmu_src/friction/KarnoppMass.c: phi3 = 1.0;  ->  phi3 = (1.05 * 1.0);": (
        "the first term of a series, below 1e-16"
    ),
    "fmu_src/friction/KarnoppMass.c: if (dy * jerk < 0.0) {  ->  if (dy / jerk < 0.0) {": (
        "the sign is the same, and without a jerk the turn is at no time"
    ),
    "fmu_src/friction/LuGre.c: const double viscous = asymmetric && v < 0.0 ? sigma2_neg : sigma2;  ->  const"
    " double viscous = asymmetric && v <= 0.0 ? sigma2_neg : sigma2;": (
        "at v = 0, viscous friction is 0 for all coefficients"
    ),
    "fmu_src/friction/PrandtlTomlinson.c: const double shift = floor(y[0] / a + 0.5) * a, from = X - shift;  "
    "->  const double shift = floor(y[0] * a + 0.5) * a, from = X - shift;": (
        "whole periods, too; the rounding that they save is below that of x"
    ),
    "fmu_src/friction/PrandtlTomlinson.c: motion.pace * (model->F - PI * E0 / a * sin(TWO_PI * (x / a - floor(x / a "
    "+ 0.5)))) / m - motion.damping * w;  ->  motion.pace * (model->F - PI * E0 / a * sin(TWO_PI * (x / a - floor(x / "
    "a + (1.05 * 0.5))))) / m - motion.damping * w;": ("whole periods, too"),
    "fmu_src/friction/PrandtlTomlinson.c: if (!noise->drawn || noise->left <= slack) {  ->  if (!noise->drawn"
    " || noise->left < slack) {": ("a rest of exactly a millionth of the interval"),
    "fmu_src/friction/ResetIntegrator.c: if (dx > 0.0 && z < z0)  ->  if (dx > 0.0 && z <= z0)": (
        "at its limit, z stays z0 either way"
    ),
    "fmu_src/friction/ResetIntegrator.c: m->run.outputs_done = true;  ->  dropped": ("the outputs are computed twice"),
    "fmu_src/friction/SevenParameter.c: if (!(now > last->begin))  ->  if (!(now >= last->begin))": (
        "of two pieces that begin together, the search finds the later one"
    ),
    "fmu_src/friction/SevenParameter.c: if (follows && to->thinned == from->thinned && to->count > 0) {  ->  if "
    "(follows && to->thinned == from->thinned && to->count >= 0) {": (
        "an empty history is that of the start; the place before the ring holds what has just been copied"
    ),
    "fmu_src/friction/SwitchMass.c: if (until < t) {  ->  if (until <= t) {": (
        "no force exceeds static friction in both directions, and at the end of the step the phase follows from "
        "the states"
    ),
    "fmu_src/friction/transition.h: const bool stops = v * slope < 0.0 && fabs(v + slope * h) <= 4.0 * DBL_EPSILON "
    "* fabs(v);  ->  const bool stops = v / slope < 0.0 && fabs(v + slope * h) <= 4.0 * DBL_EPSILON * fabs(v);": (
        "the sign is the same, and without a slope the second condition fails"
    ),
    "fmu_src/friction/chain.h: const double turns = floor(mean + 0.5);  ->  const double turns = floor(mean - 0.5);": (
        "whole periods, too"
    ),
    "fmu_src/friction/modified_leuven.h: p.near = slope != 0.0 && (p.backwards ? -p.force : p.force) > 0.999 "
    "* nearness * piece_level(&p, s);  ->  p.near = slope != 1.0 && (p.backwards ? -p.force : p.force) > "
    "0.999 * nearness * piece_level(&p, s);": (
        "at constant velocity, the place to which the force is drawn does not move"
    ),
    "fmu_src/friction/transition.h: static inline double flat_until(double n) { return n < 8.0 ? 0.0 : "
    "exp(-36.0 / n); }  ->  static inline double flat_until(double n) { return n < (1.05 * 8.0) ? 0.0 : "
    "exp(-36.0 / n); }": ("where the parts of a step end; |r|^n is below rounding there"),
    "fmu_src/friction/transition.h: const bool stops = v * slope < 0.0 && fabs(v + slope * h) <= 4.0 * DBL_EPSILON "
    "* fabs(v);  ->  const bool stops = v * slope < 0.0 && fabs(v + slope * h) < 4.0 * DBL_EPSILON * fabs(v);": (
        "a rounding error of exactly the bound"
    ),
    "fmu_src/numerics/attraction.h: *error = all > longest ? INF : fabs(gained - gained_simpson) / size + "
    "fabs(all - all_simpson);  ->  *error = all >= longest ? INF : fabs(gained - gained_simpson) / size + "
    "fabs(all - all_simpson);": ("a piece of exactly the largest length"),
    "fmu_src/numerics/attraction.h: const double limit = smooth ? fmin(0.1 * cbrt(square(allowed / weight)), "
    "0.1) : fmin(allowed / weight, 0.1);  ->  const double limit = smooth ? fmin(0.1 * cbrt(square(allowed / "
    "weight)), 0.1) : fmin(allowed / weight, (1.05 * 0.1));": ("the length of pieces that no tolerance limits"),
    "fmu_src/numerics/extrapolation.h: *d->left -= 2.0 * (k + 1) * N;  ->  *d->left -= 2.0 * (k + 1) / N;": (
        "how much work is refused"
    ),
    "fmu_src/numerics/extrapolation.h: double y_end[2 * MASSES], H = *inner > 0.0 ? *inner : 0.5 / d->rate;  "
    "->  double y_end[2 * MASSES], H = *inner > 0.0 ? *inner : 0.5 * d->rate;": ("the first try of an inner step"),
    "fmu_src/numerics/extrapolation.h: double y_end[2 * MASSES], H = *inner > 0.0 ? *inner : 0.5 / d->rate;  "
    "->  double y_end[2 * MASSES], H = *inner > 1.0 ? *inner : 0.5 / d->rate;": ("the first try of an inner step"),
    "fmu_src/numerics/relaxation.h: allowed = fmax(tolerance, 4.0 * DBL_EPSILON * fabs(start));  ->  allowed "
    "= fmax(tolerance, (1.05 * 4.0) * DBL_EPSILON * fabs(start));": ("a bound of rounding errors, below the tolerance"),
    "fmu_src/numerics/relaxation.h: const double part = tries % 3 == 2 ? 0.5 : clip(-low / (high - low), "
    "1e-3, 1.0 - 1e-3);  ->  const double part = tries % 3 == 2 ? 0.5 : clip(-low / (high - low), 1e-3, (1.05"
    " * 1.0) - 1e-3);": ("the place of the next try, not the bracket"),
    "fmu_src/numerics/relaxation.h: if (converged || (row >= 2 && !(error <= 2.0 * previous)))  ->  if "
    "(converged || (row >= 2 && !(error < 2.0 * previous)))": ("an error of exactly twice the previous one"),
    "fmu_src/numerics/relaxation.h: *step = fmin(*step, (4.0 * detail + 2.0 * fabs(start)) / fabs(rate));  ->  "
    "*step = fmin(*step, ((1.05 * 4.0) * detail + 2.0 * fabs(start)) / fabs(rate));": ("the length of the first step"),
    "fmu_src/numerics/rodas.h: const double factor = error < 0.0 ? 0.2 : clip(0.9 * pow(fmax(error, 1e-12), "
    "-0.25), 0.2, 6.0);  ->  const double factor = error < 0.0 ? (1.05 * 0.2) : clip(0.9 * pow(fmax(error, "
    "1e-12), -0.25), 0.2, 6.0);": ("the size of the next try"),
    "fmu_src/numerics/roots.h: b->f_high *= b->moved < 0 ? 0.5 : 1.0;  ->  b->f_high *= b->moved < 0 ? 0.5 : "
    "(1.05 * 1.0);": ("a weight of the next try, not of the bracket"),
    "fmu_src/numerics/search.h: if (column(table, middle) <= x)  ->  if (column(table, middle) < x)": (
        "both intervals have the same value at their common end, or rounding is added to the place"
    ),
    "fmu_src/signals/Record.c: const double place = (t - series[0][0]) / (series[LAST][0] - series[0][0]) * "
    "(double)LAST;  ->  const double place = (t + series[0][0]) / (series[LAST][0] - series[0][0]) * "
    "(double)LAST;": ("what this search misses, another finds"),
    "fmu_src/signals/Record.c: for (size_t i = guess; i < guess + 4 && i < LAST; i++) {  ->  for (size_t i = "
    "guess; i <= guess + 4 && i < LAST; i++) {": ("what this search misses, another finds"),
    "fmu_src/wasm/print.c: if (last > d->low) {  ->  if (last >= d->low) {": ("the digit behind the last one is 0"),
    "harness/engine/defect.h: p->unstable += fabs(p->fed) > FED * p->flow && fabs(p->fed) > 0.5 * fabs(p->net);  "
    "->  p->unstable += fabs(p->fed) > FED * p->flow && fabs(p->fed) >= 0.5 * fabs(p->net);": (
        "an energy of exactly half of the other"
    ),
    "harness/engine/engine.c: if (operations[0] != SET || operations[2] != STEP || operations[4] != GET || "
    "operations[3] != part ||  ->  if (operations[0] != SET || operations[2] != STEP || operations[4] == GET "
    "|| operations[3] != part ||": ("the operations of each part one by one give the same"),
    "harness/engine/fixed_point.h: for (double part = 1.0; part > 1e-3; part *= 0.5) {  ->  for (double part = "
    "1.0; part > 1e-3; part *= (1.05 * 0.5)) {": ("the lengths that are tried, not the accuracy of the best one"),
    "harness/engine/step_check.h: if (newton->moving[k].inner && bend > BENT * fabs(change) && bend > SLIGHT * "
    "newton->moving[k].scale)  ->  if (newton->moving[k].inner && bend > BENT * fabs(change) && bend >= SLIGHT * "
    "newton->moving[k].scale)": ("a deviation of exactly a thousandth of the magnitude"),
    "harness/engine/tick.h: if (e->manipulator_count > 0 && e->begins)  ->  if (e->manipulator_count >= 0 && "
    "e->begins)": ("without manipulators there is nothing to set"),
    "harness/masters/newton.h: p->done = s.to >= 1.0 ? p->h : p->done + piece;  ->  p->done = s.to >= (1.05 * "
    "1.0) ? p->h : p->done + piece;": (
        "a share of a step is 1 or less, and sums of pieces end at the step to rounding"
    ),
    "fmu_src/friction/modified_leuven.h: if (fabs(p->force - S) <= grain * S && fabs(change) <= grain * S)  ->"
    "  if (fabs(p->force - S) < grain * S && fabs(change) <= grain * S)": ("a force exactly at the bound of rounding"),
    "fmu_src/controllers/LeuvenFeedforward.c: follow_reference(m, forget, !isnan(z + A + zc + n + Fc + Fs + vs"
    " + delta + dead_band));  ->  follow_reference(m, forget, !isnan(z + A + zc + n + Fc + Fs + vs - delta + "
    "dead_band));": ("a sum and a difference of numbers are no number together, for finite vs and delta"),
    "fmu_src/controllers/RepetitiveController.c: return is_flag(&past->known) && is_count(past->missing, 2.0) "
    "&& is_direction(past->limited);  ->  return is_flag(&past->known) && is_count(past->missing, (1.05 * "
    "2.0)) && is_direction(past->limited);": ("a count is whole"),
    "fmu_src/friction/GMS.c: const double b = a + 1.000001 * width >= h ? h : a + width;  ->  const double b ="
    " a + (1.05 * 1.000001) * width >= h ? h : a + width;": ("whether a last piece is joined to the one before it"),
    "fmu_src/friction/SwitchMass.c: if (--*left < 0)  ->  if (--*left <= 0)": ("a limit of a million inner steps"),
    "fmu_src/friction/SevenParameter.c: .slope = c[1] + t * (2.0 * c[2] + t * 3.0 * c[3])};  ->  .slope = c[1]"
    " + t * (2.0 * c[2] + t * (1.05 * 3.0) * c[3])};": ("the slope of a search, which stops by its value"),
    "fmu_src/friction/GenericAsperity.c: const double length = wavelength * (1.0 + wavelength_spread * (2.0 * "
    "uniform_at(seed, i / 2, 2) - 1.0));  ->  const double length = wavelength * (1.0 - wavelength_spread * "
    "(2.0 * uniform_at(seed, i / 2, 2) - 1.0));": ("a random length between the same bounds"),
    "fmu_src/friction/GenericAsperity.c: model->der_z = v == 0.0 ? -sums.speed / N : v - (v * "
    "sums.moving[forward] + sums.speed) / N;  ->  model->der_z = v == 1.0 ? -sums.speed / N : v - (v * "
    "sums.moving[forward] + sums.speed) / N;": ("both formulas agree at rest"),
    "fmu_src/friction/KarnoppMass.c: while (rest > 0.0 && events++ < MOST_EVENTS) {  ->  while (rest > 0.0 && "
    "events++ <= MOST_EVENTS) {": ("a limit of events, of which a step has fewer"),
    "fmu_src/fmi2_exchange.h: if (-to_next_sample(m) / m->Ts > MOST_TRIES)  ->  if (-to_next_sample(m) * m->Ts"
    " > MOST_TRIES)": ("the event is refused either way, and the state restored"),
    "fmu_src/friction/BurridgeKnopoff.c: const double s = f->ready ? m->time - f->time : 0.0;  ->  const "
    "double s = f->ready ? m->time - f->time : 1.0;": ("before the first step, nothing moves"),
    "fmu_src/friction/ResetIntegrator.c: else if (dx < 0.0 && z > -z0)  ->  else if (dx <= 0.0 && z > -z0)": (
        "without a way, z stays as it is"
    ),
    "fmu_src/friction/modified_leuven.h: if (k[i] > 0.0 && room > grain * W[i]) {  ->  if (k[i] >= 0.0 && room"
    " > grain * W[i]) {": ("an element without stiffness adds nothing, and its room is over at no place"),
}
"""Mutants that no test can find, as they are printed but without the number of the line, and why."""
FOLDERS = {  # tests of what no single block is compiled with, by the beginning of the path
    "fmu_src/block.h": ("shell/",),
    "fmu_src/composite/": ("composite/",),
    "fmu_src/fmi2": ("shell/", "exchange/"),
    "fmu_src/fmi3/": ("fmi3/", "shell/", "exchange/", "check/"),
    "fmu_src/numerics/": ("models/test_numerics.py",),
    "fmu_src/solver.h": ("shell/",),
    "fmu_src/wasm/": ("wasm/",),
    "harness/": ("harness/", "accuracy/"),
}
PYTEST = ("-q", "-p", "no:cacheprovider", "--no-header", "--tb=line", "-rfE")
PYTEST += ("-W", "ignore::pytest.PytestAssertRewriteWarning")
IMPORTED = (
    *("casadi", "fmpy", "hypothesis", "lxml.etree", "matplotlib.pyplot", "pandas", "plotly.graph_objects", "pytest"),
    *("scipy.integrate", "scipy.optimize", "scipy.signal", "scipy.stats", "xarray"),
    *(
        "quick",
        "shell.fixtures",
        "shell.selection",
        "friction_fmus.export.block_fmu",
        "friction_fmus.identification",
    ),
    *("friction_fmus.study", "harness.engine.native", "harness.ssp", "harness.system.system"),
)
"""What the tests import, once for all mutants, which change no Python."""
NOT_COMPILED = 77


@dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.change}"

    @property
    def change(self) -> str:
        return f"{self.old.strip()}  ->  {self.new.strip() or 'dropped'}"

    def place_in_draw(self, seed: int) -> bytes:
        """Return what sorts the mutants at random; an edit elsewhere draws no others."""
        return hashlib.sha256(f"{seed} {self.file} {self.change}".encode()).digest()

    @property
    def reason(self) -> str | None:
        """Why no test can find it."""
        return EQUIVALENT.get(f"{self.file}: {self.change}")


def changes(line: str) -> Iterator[str]:
    """The line with one thing wrong."""
    for old, new in OTHERS.items():
        for match in re.finditer(re.escape(old), line):
            yield line[: match.start()] + new + line[match.end() :]
    for match in re.finditer(r"(?<![\w.])\d+\.\d+(?:e[-+]?\d+)?(?!\w)", line):
        yield (
            line[: match.start()] + ("1.0" if float(match[0]) == 0.0 else f"(1.05 * {match[0]})") + line[match.end() :]
        )
    if re.match(r"\s+(\w[\w.>\[\]-]* [-+*/]?= .*|\w+\(.*\));$", line) and "static" not in line:
        yield ""


def mutants() -> list[Mutant]:
    """All of them; comments and directives are left alone."""
    folders = ("fmu_src", "harness/engine", "harness/masters")
    listed = subprocess.run(["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True)
    found = []
    for file in listed.stdout.split():
        if Path(file).suffix in (".c", ".h"):
            text = (ROOT / file).read_text(encoding="utf-8")
            code = re.sub(r"/\*.*?\*/", lambda comment: "\n" * comment[0].count("\n"), text, flags=re.S)
            for number, (line, bare) in enumerate(zip(text.split("\n"), code.split("\n"), strict=True), start=1):
                if not bare.lstrip().startswith(("#", '"')) and not line.endswith("\\"):
                    found += [Mutant(file, number, line, new) for new in changes(bare.rstrip())]
    return found


@dataclass
class TestFile:
    """What a test file opens, by name without suffix, and its processor time."""

    opens: list[str] = field(default_factory=list)
    seconds: float = 0.0


class Measures:
    """A plugin of pytest that measures the test files."""

    def __init__(self, path: Path) -> None:
        self.path, self.files, self.current = path, defaultdict(TestFile), ""
        sys.addaudithook(self.notice)

    def notice(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.current and event in ("open", "ctypes.dlopen") and isinstance(arguments[0], str | Path):
            path = Path(arguments[0])
            if path.suffix in (".fmu", ".so", ".dylib", ".dll"):
                name = re.sub("-[0-9a-f]{24}$", "", path.stem)
                opens = self.files[self.current].opens
                opens += [] if name in opens else [name]

    def pytest_runtest_logstart(self, location: tuple[str, int | None, str]) -> None:
        self.current, self.begin = location[0], sum(os.times()[:4])

    def pytest_runtest_logfinish(self) -> None:
        self.files[self.current].seconds += sum(os.times()[:4]) - self.begin
        self.current = ""

    def pytest_sessionfinish(self) -> None:
        self.path.write_text(json.dumps({file: vars(found) for file, found in self.files.items()}, indent=1))


class Finder:
    """Runs tests on mutants in a copy of the repository."""

    def __init__(self, scratch: Path, measured: Path | None) -> None:
        self.folder, self.log = scratch / "copy", scratch / "log"
        subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(self.folder)], check=True)
        changed = subprocess.run(["git", "ls-files", "-mo", "--exclude-standard"], cwd=ROOT, capture_output=True)
        os.chdir(ROOT)
        for name in filter(os.path.isfile, changed.stdout.decode().split()):
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, self.folder / name)
        os.chdir(self.folder)
        os.environ |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(self.folder)}
        os.environ.setdefault("FRICTION_FMUS_CACHE", str(scratch / "cache"))
        sys.path[:0] = [str(self.folder), str(self.folder / "tests")]
        for module in IMPORTED:
            importlib.import_module(module)
        keep_laws()
        file = measured or scratch / "measured.json"
        if not file.exists() and self.run(lambda: pytest_run((), Measures(file)), 24.0 * 3600.0) != 0:
            sys.exit(f"tests fail without any mutant:\n{self.log.read_text()[-4000:]}")
        self.files = {name: TestFile(**found) for name, found in json.loads(file.read_text()).items()}
        libraries = scratch / "libraries.json"
        self.run(lambda: write_libraries(libraries), 300.0)
        self.libraries: dict[str, list[str]] = json.loads(libraries.read_text())
        self.found_by: dict[str, list[str]] = defaultdict(list)
        self.failed = ""

    def run(self, work: Callable[[], int], seconds: float) -> int:
        """The status of a forked process, which may use so much processor time."""
        child = os.fork()
        if child == 0:
            os.setsid()
            for limit, most in ((resource.RLIMIT_CPU, int(seconds)), (resource.RLIMIT_DATA, 6 << 30)):
                resource.setrlimit(limit, (most, most + 5))
            signal.alarm(int(20.0 * seconds))  # for one that waits for ever
            output = os.open(self.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(output, 1)
            os.dup2(output, 2)
            status = 1
            try:
                status = work()
            finally:
                sys.stdout.flush()
                os._exit(status)
        _, status = os.waitpid(child, 0)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        return os.waitstatus_to_exitcode(status)

    def fails(self, files: list[str]) -> bool:
        """Whether a test in these files fails."""
        if not files:
            return False
        expected = sum(self.files[file].seconds for file in files)
        status = self.run(lambda: pytest_run(files), 5.0 * expected + 30.0)
        failed = re.findall(r"^(?:FAILED|ERROR) ([\w/.]+)", self.log.read_text(errors="replace"), re.M)
        self.failed = failed[0] if failed else f"ended with status {status}"
        return status not in (0, 5)  # 5: all tests are for the night

    def found(self, mutant: Mutant, most: float) -> bool | None:
        """Whether a test fails; None if the mutant does not compile."""
        path = self.folder / mutant.file
        text = path.read_text(encoding="utf-8")
        lines = text.split("\n")
        lines[mutant.line - 1] = mutant.new
        path.write_text("\n".join(lines), encoding="utf-8")
        try:
            if self.run(lambda: compiled(mutant.file, self.libraries.get(path.name, [])), 300.0) == NOT_COMPILED:
                return None
            users = self.users(mutant.file)
            others = sorted(set(self.files) - set(users), key=lambda file: self.files[file].seconds)
            others = others if most == math.inf else []
            files = [*self.within([*users, *others], most)]
            for size in (2**k - 1 for k in range(9)):  # few at first, as pytest reads all files before it begins
                batch = files[size : 2 * size + 1]
                if self.fails(batch):
                    self.found_by[mutant.file].append(self.failed)
                    return True
            return False
        finally:
            path.write_text(text, encoding="utf-8")

    def within(self, files: list[str], most: float) -> Iterator[str]:
        """The first files that take so much processor time, and at least one."""
        spent = 0.0
        for file in files:
            if spent < most:
                yield file
            spent += self.files[file].seconds

    def users(self, file: str) -> list[str]:
        """The test files that open what a C file is compiled into, those first that are likely to fail soon."""
        names = {"engine"} if file.startswith("harness") else set(self.libraries.get(Path(file).name, ()))
        folders = next((folders for start, folders in FOLDERS.items() if file.startswith(start)), ())
        folders = tuple(f"tests/{folder}" for folder in folders)
        stem = Path(file).stem.lower()
        users = [
            test
            for test, measured in self.files.items()  # a library that an earlier file has opened is not opened again
            if names & set(measured.opens) or test.startswith(folders) or stem in test.replace("_", "")
        ]

        def cost(test: str) -> float:
            """Its time over how likely it fails, roughly."""
            opens = set(self.files[test].opens)
            for_it = len(names & opens) / len(opens) if names & opens else 0.1
            likely = 1 + 4 * self.found_by[file].count(test) + 3 * (stem in test.replace("_", ""))
            likely += 2 * test.startswith(folders or "none")
            return (self.files[test].seconds + 0.5) / (for_it * likely)

        return sorted(users, key=cost)


def pytest_run(files: list[str] | tuple[str, ...], *plugins: object) -> int:
    import pytest
    from hypothesis import Phase, settings

    settings.register_profile("unshrunk", phases=(Phase.explicit, Phase.generate))
    settings.load_profile("unshrunk")
    return int(pytest.main([*PYTEST, *(("-x",) if files else ()), *files], plugins=list(plugins)))


def keep_laws() -> None:
    """Keep the C that laws are translated to, and forget the blocks in C."""
    from friction_fmus.blocks import catalogue

    laws = {entry: catalogue._read(entry) for entry in catalogue.listing().values() if entry.path.suffix == ".py"}
    catalogue._known_c_block.cache_clear()
    catalogue._read = lambda entry: laws.get(entry) or catalogue._known_c_block(entry.path, entry.kind)


def write_libraries(path: Path) -> int:
    """Write the names of the blocks that each C file is compiled into; not in a process that keeps the catalogue."""
    from friction_fmus import catalogue
    from friction_fmus.export.block_fmu import _sources

    blocks = defaultdict(list)
    for block in catalogue().values():
        for source in _sources(block, {}):
            blocks[source].append(block.name)
    path.write_text(json.dumps(blocks))
    return 0


def compiled(file: str, blocks: list[str]) -> int:
    """Compile what a C file belongs to."""
    from quick import quick_builds

    from friction_fmus import BuildError, build, find
    from friction_fmus.blocks.customise import identified
    from friction_fmus.cli.inputs import open_system
    from friction_fmus.export.block_fmu import _sources
    from harness.compiling.engine_library import library
    from harness.compiling.platforms import native_library

    try:
        with quick_builds(Path("shell")), tempfile.TemporaryDirectory() as folder:
            if file.startswith("harness"):
                library()
            elif file.startswith("fmu_src/composite"):
                with open_system(Path("examples/stick_slip.toml")) as system:
                    system.to_fmu(Path(folder) / "stick_slip.fmu")
            elif file.startswith(("fmu_src/fmi3", "fmu_src/wasm")):
                build("LuGre", folder, **({"fmi": 3} if "fmi3" in file else {"platforms": ("wasm32",)}))
            else:
                block = find(blocks[0])
                native_library(identified(_sources(block, {}), block.name), block.name)
    except BuildError as error:
        return NOT_COMPILED if re.search("does not compile|cannot be linked", str(error)) else 0
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int, nargs="?", default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--measured", type=Path)
    parser.add_argument("--seconds", type=float, default=math.inf)
    options = parser.parse_args()
    measured = options.measured.resolve() if options.measured else None
    drawn = sorted(mutants(), key=lambda mutant: mutant.place_in_draw(options.seed))
    counted, survivors = 0, []
    with tempfile.TemporaryDirectory() as scratch:
        finder = Finder(Path(scratch), measured)
        for number, mutant in enumerate(drawn[options.first :], start=options.first):
            if counted == options.count:
                break
            if mutant.reason:
                print(f"{number} equivalent {mutant} ({mutant.reason})", flush=True)
                continue
            begin = time.monotonic(), sum(os.times()[:4])
            found = finder.found(mutant, options.seconds)
            counted += found is not None
            result = {True: f"found by {finder.failed}", False: "SURVIVES", None: "does not compile"}[found]
            spent = f"{sum(os.times()[:4]) - begin[1]:.0f} s of processor time, {time.monotonic() - begin[0]:.0f} s"
            print(f"{number} {result}: {mutant} ({spent})", flush=True)
            survivors += [mutant] if found is False else []
    print(f"{counted - len(survivors)} of {counted} mutants are found", *survivors, sep="\n")
    return int(len(survivors) > 0.05 * counted)


if __name__ == "__main__":
    sys.exit(main())
