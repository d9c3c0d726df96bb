"""An axis: its servo, its plant, and their closed loop. Identification and study build on it."""
