"""Axes with known truth: what a study says about them, and what its recommendation achieves on them.

``python tests/slow/axes_of_the_study.py --out DIR`` writes log and settings of each axis, runs the study, runs the
exported C in the loop of the true axis, and prints a table; it resumes after an interruption. ``--only NAME`` studies
one axis, ``--default`` leaves models and compensators to the study, ``--again`` repeats what is there, and ``--table``
only prints. The status is 1 if a recommendation saturates or worsens an axis.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))

from independent_axes import AXES, SimulatedAxis
from independent_axis import exported_law, law_of_loop

from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import FrictionError

CLAIMED = 0.15  # largest relative difference between claimed and achieved error
BEST = 1.3  # largest ratio of achieved error to that of the best candidate
COVERED = 0.85  # smallest fraction of 90 % intervals that contain the true value
NORMAL_90 = 1.645  # half width of a 90 % interval in standard errors
TUNED = 2e-5  # step of the runs of a search [s]

NOT_CLAIMED = r"cannot be (claimed|predicted|promised)|does not support|not be trusted"
BIASED = r"biased"


def judged(name: str, axis: SimulatedAxis, folder: Path, default: bool) -> dict[str, Any]:
    """Study an axis and compare the result with the truth."""
    axis.write(folder, name, default=default)
    begin = time.monotonic()
    command = [sys.executable, "-m", "friction_fmus", "study", "axis.toml", "-o", "out"]
    environment = os.environ | {"COLUMNS": "100"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment, check=False)
    seconds = time.monotonic() - begin
    (folder / "terminal.txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    found: dict[str, Any] = {"axis": name, "status": done.returncode, "seconds": round(seconds, 1)}
    result = folder / "out" / "study.json"
    if "Traceback" in done.stderr or not result.exists():
        return found | {"crash": done.stderr.strip().splitlines()[-1:] or ["no study.json"], **achieved(axis, None)}
    study = json.loads(result.read_text(encoding="utf-8"))
    text = said(study)
    best = next((model for model in study["models"] if model["rank"] == 1), None)
    rigid = next((model for model in study["models"] if model["name"].startswith("Coulomb + viscous")), None)
    recommended = study["recommendation"]["name"]
    entries = {entry["name"]: entry for entry in study["compensators"]}
    claimed = entries[recommended]["metrics"] if recommended in entries else None
    found |= {
        "recommended": recommended,
        "plant": study["plant"] or (best["name"] if best else ""),
        "findings": [finding["name"] for finding in study["findings"]],
        "stops": any(finding["stops"] for finding in study["findings"]),
        "claimed": claimed["rms"] if claimed else None,
        "claims": [rung["metrics"]["rms"] for rung in study["ladder"]],
        "models": [model["name"] for model in study["models"] if model["rank"]],
        "identified": identified(best, axis),
        "rigid": identified(rigid, axis),
        "text": text,
    }
    found |= achieved(axis, loop_of(folder, axis, study, recommended, rigid))
    return found | {"candidates": tried(folder, axis, study)}


def said(study: dict[str, Any]) -> str:
    """Return the sentences of a study about this axis: findings, warnings, violated conditions, recommendation."""
    lines = [f"{each['name']}: {each['what']} {each['change']}" for each in study["findings"]]
    lines += [text for name, text in study["overview"].items() if name.startswith("finding")]
    for model in study["models"]:
        if model["rank"] == 1:
            lines += [f"best model {model['name']}", *(f"{model['name']}: {text}" for text in model["warnings"])]
            if model.get("position"):
                lines.append("force over position: cogging")
    lines += [f"{each['name']}: {each['wrong']}; {each['change']}" for each in study["conditions"] if not each["ok"]]
    lines += [study["no_compensation"], study["recommendation"]["reason"], *study["recommendation"]["next_steps"]]
    lines += study["recommendation"]["cautions"]
    return "\n".join(line for line in lines if line)


def identified(model: dict[str, Any] | None, axis: SimulatedAxis) -> dict[str, Any]:
    """Return true value, estimate, and whether the 90 % interval contains the true value, by parameter."""
    found = {}
    for each in model["parameters"] if model else []:
        if each["name"] in axis.truth and each["standard_error"] is not None:
            truth, width = axis.truth[each["name"]], NORMAL_90 * each["standard_error"]
            covers = abs(each["value"] - truth) <= width
            found[each["name"]] = {"true": truth, "value": each["value"], "half": width, "covers": covers}
    return found


def loop_of(
    folder: Path, axis: SimulatedAxis, study: dict[str, Any], recommended: str, rigid: dict[str, Any] | None
) -> dict[str, Any] | None:
    """Return what to simulate for a recommendation: changes of the servo, or an exported law."""
    if not recommended:
        return None
    code = folder / "out" / "recommended" / "c"
    if (code / "loop.c").exists():
        with tempfile.TemporaryDirectory() as scratch:
            law = exported_law(code, Path(scratch))
        filtered = "notch" in law.header.lower()
        return {"law": law, "law_notched": 0.0 if filtered else 1.0}
    if recommended == "none":
        values = {each["name"]: each["value"] for each in rigid["parameters"]} if rigid else {}
        mass, offset = values.get("M", axis.truth["M"]), values.get("OF", 0.0)
        return {"fed_velocity": 1.0, "fed_mass": mass, "fed_offset": offset}
    return None


def tried(folder: Path, axis: SimulatedAxis, study: dict[str, Any]) -> list[dict[str, Any]]:
    """Return claimed and achieved errors of all ranked candidates whose loop can be written as that of the best one."""
    file = folder / "out" / "recommended" / "loop.toml"
    if not file.exists():
        return []
    whole, found = tomllib.loads(file.read_text(encoding="utf-8")), []
    for entry in study["compensators"]:
        if not entry["rank"] or not entry["metrics"] or "IntegralAction" in entry["name"]:
            continue  # integral action changes the servo
        *others, last = [name for name in entry["name"].split(" + ") if name != "PositionMap"] or [""]
        parts = {"feedforward": others[0], "compensator": last} if others else {"compensator": last} if last else {}
        values = {name if "." in name else f"{last}.{name}": value for name, value in entry["parameters"].items()}
        content = {key: whole[key] for key in ("loop", "servo")}
        if "PositionMap" in entry["name"] and "table" in whole:
            content["table"] = whole["table"]
        for table, law in parts.items():
            own = {name.partition(".")[2]: value for name, value in values.items() if name.startswith(f"{law}.")}
            use = find(law).about.use
            content[table] = {"law": law, "output": use.output if use else "u", "parameters": own}
        own = axis.servo.get("fed_coulomb", 0.0) if axis.declared else 0.0
        if own and not any(find(law).about.use.kind in ("feedforward", "model feedback") for law in parts.values()):
            place = "feedforward" if parts else "compensator"  # the friction feedforward of the drive stays
            content[place] = {"law": "CoulombFeedforward", "output": "u", "parameters": {"Fc": own, "m": 0.0}}
        error = _error_of(content, axis, None if last == "" else entry["gain"])
        claimed = {"name": entry["name"], "rank": entry["rank"], "claimed": entry["metrics"]["rms"]}
        found.append(claimed | error)
    return found


def _error_of(content: dict[str, Any], axis: SimulatedAxis, gain: float | None) -> dict[str, Any]:
    """Return error and fraction of samples at the limit of a loop, with its gain if its law has one."""
    with tempfile.TemporaryDirectory() as scratch:
        for has_gain in (True, False):
            given = content
            if has_gain and gain is not None and "compensator" in content:
                own = content["compensator"]
                given = content | {"compensator": own | {"parameters": {**own["parameters"], "gain": gain}}}
            try:
                law = law_of_loop(given, Path(scratch))
                break
            except FrictionError as error:
                reason = str(error)
        else:
            return {"failed": reason}
        run = axis.run(law=law, law_notched=1.0)
    limited = float(np.mean(np.abs(run.command) >= 0.999 * axis.servo["limit"]))
    error = float(np.sqrt(np.mean((axis.reference.r - run.x1) ** 2))) if run.finite else float("inf")
    return {"achieved": error, "limited": limited}


def achieved(axis: SimulatedAxis, loop: dict[str, Any] | None) -> dict[str, Any]:
    """Return errors on the true axis [m] and fractions of samples at the limit: as it is, best feedforwards, loop."""
    found: dict[str, Any] = {}
    limit = axis.servo["limit"]

    def error(half: bool = False, **changed: Any) -> float:
        own = axis if not half else _Half(**{key: getattr(axis, key) for key in axis.__dataclass_fields__})
        run, r = own.run(**changed), own.reference.r
        if not run.finite:
            return float("inf")
        found["last limited"] = float(np.mean(np.abs(run.command) >= 0.999 * limit))
        found["last load"] = float(np.sqrt(np.mean((r - run.x2) ** 2)))
        return float(np.sqrt(np.mean((r - run.x1) ** 2)))

    def tuned(names: tuple[str, ...], start: tuple[float, ...], evaluations: int) -> dict[str, float]:
        def cost(values: np.ndarray) -> float:
            given = dict(zip(names, (values * scale).tolist(), strict=True))
            return np.log(error(half=True, step=TUNED, fed_velocity=1.0, **given))

        scale = np.array([max(abs(value), 1.0) for value in start])
        simplex = np.vstack([np.array(start) / scale, np.array(start) / scale + 0.15 * np.eye(len(start))])
        options = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3}
        best = minimize(cost, simplex[0], method="Nelder-Mead", options=options)
        return {"fed_velocity": 1.0, **dict(zip(names, (best.x * scale).tolist(), strict=True))}

    p = axis.axis
    mass, Fc, Fv = (
        p["m1"] + p.get("m2", 0.0),
        p.get("Fc1", 0.0) + p.get("Fc2", 0.0),
        p.get("Fv1", 0.0) + p.get("Fv2", 0.0),
    )
    found["as it is"] = error()
    found["limited as it is"] = found["last limited"]
    motion = tuned(("fed_mass", "fed_viscous"), (mass, Fv), 40)
    found["motion"] = error(**motion, fed_coulomb=0.0)
    start = (motion["fed_mass"], motion["fed_viscous"], Fc, p.get("weight", 0.0))
    friction = tuned(("fed_mass", "fed_viscous", "fed_coulomb", "fed_offset"), start, 80)
    found["motion and friction"] = error(**friction)
    found["tuned"] = friction
    if loop is not None:
        found["recommended loop"] = error(**loop)
        found["limited"] = found["last limited"]
        found["load error"] = found["last load"]
    return {key: value for key, value in found.items() if not key.startswith("last")}


class _Half(SimulatedAxis):
    """The first half of the motion, for searches."""

    @property
    def reference(self) -> Any:
        whole = super().reference
        n = len(whole.r) // 2
        return replace(whole, r=whole.r[:n], rd=whole.rd[:n], rdd=whole.rdd[:n])


def verdicts(found: dict[str, Any]) -> dict[str, bool | None]:
    """Return which aims are reached; None where an aim does not apply."""
    true, limited = found.get("recommended loop"), found.get("limited", 0.0)
    aims: dict[str, bool | None] = {"safe": None, "claim": None, "best": None, "intervals": None}
    names, text = AXES[found["axis"]].names, found.get("text", "")
    aims["named"] = bool(re.search(names, text, re.IGNORECASE)) if names else None
    if "crash" in found:
        return aims | {"safe": False}
    parameters = [each["covers"] for each in found["identified"].values()]
    if parameters:
        aims["intervals"] = bool(re.search(BIASED, text)) or float(np.mean(parameters)) >= COVERED
    if true is not None:
        aims["safe"] = true <= 1.05 * found["as it is"] and limited <= max(0.01, found["limited as it is"])
        others = [each["achieved"] for each in found["candidates"] if "achieved" in each]
        candidates = (found["as it is"], found["motion"], found["motion and friction"], true, *others)
        aims["best"] = true <= BEST * min(candidates)
        aims["claim"] = bool(re.search(NOT_CLAIMED, text)) or abs(true / found["claimed"] - 1.0) <= CLAIMED
    return aims


def table(results: list[dict[str, Any]]) -> str:
    """Return all results as a table in Markdown."""
    head = [
        *("axis", "s", "plant", "M true/found", "Fc", "Fv", "findings", "recommended", "claimed um", "achieved um"),
        *("ratio", "as it is um", "best motion um", "with friction um", "at limit %", "covered"),
        *("safe", "claim", "best", "intervals", "named"),
    ]
    lines = [head, ["---"] * len(head)]
    for found in results:
        aims = [{True: "yes", False: "NO", None: "-"}[value] for value in verdicts(found).values()]
        if "crash" in found:
            lines.append([found["axis"], f"{found['seconds']:.0f}", f"crash: {found['crash']}", *[""] * 13, *aims])
            continue
        true, claimed, own = found.get("recommended loop"), found["claimed"], found["identified"]

        def pair(*names: str, own: dict[str, Any] = own) -> str:
            each = next((own[name] for name in names if name in own), None)
            return f"{each['true']:.4g}/{each['value']:.4g}±{each['half']:.2g}" if each else ""

        def um(value: float | None) -> str:
            return "" if value is None else f"{1e6 * value:.4g}"

        covered = [each["covers"] for each in own.values()]
        lines.append(
            [
                *(
                    found["axis"],
                    f"{found['seconds']:.0f}",
                    found["plant"],
                    pair("M"),
                    pair("Fc"),
                    pair("Fv", "sigma2"),
                ),
                ", ".join(found["findings"]) + (" (stops)" if found["stops"] else ""),
                *(found["recommended"] or "(none)", um(claimed), um(true)),
                f"{true / claimed:.2f}" if true and claimed else "",
                *(um(found["as it is"]), um(found["motion"]), um(found["motion and friction"])),
                f"{100.0 * found['limited']:.1f}" if "limited" in found else "",
                *(f"{sum(covered)}/{len(covered)}", *aims),
            ]
        )
    counts = {}
    for aim in ("safe", "claim", "best", "intervals", "named"):
        values = [verdicts(found)[aim] for found in results]
        counts[aim] = f"{values.count(True)} of {len(values) - values.count(None)}"
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{rows}\n\n{', '.join(f'{aim}: {count}' for aim, count in counts.items())}\n"


def main() -> int:
    """Study the axes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("axes"))
    parser.add_argument("--only", choices=AXES, action="append")
    parser.add_argument("--default", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    results = []
    for name in options.only or AXES:
        file = options.out / name / "result.json"
        if not options.table and (options.again or not file.exists()):
            found = judged(name, AXES[name], file.parent, options.default)
            file.write_text(json.dumps(found, indent=1), encoding="utf-8")
            print(f"{name}: {verdicts(found)}", file=sys.stderr, flush=True)
        if file.exists():
            results.append(json.loads(file.read_text(encoding="utf-8")))
    text = table(results)
    print(text)
    (options.out / "table.md").write_text(text, encoding="utf-8")
    return 1 if any(verdicts(found)["safe"] is False for found in results) else 0


if __name__ == "__main__":
    sys.exit(main())
