"""Gauss-Seidel: one part after the other, each on the newest outputs of those before it."""

from __future__ import annotations

from harness.plan import GET, SET, STEP, Plan, Program


def master(plan: Plan) -> Program:
    """Set, step and read part by part in the order of the plan: sampled parts, then plants, then sensors."""
    parts = range(len(plan.parts))
    return Program(plan, [(operation, part) for part in parts for operation in (SET, STEP, GET)])
