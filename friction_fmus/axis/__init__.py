"""An axis: its servo, its plant, and the closed loop of both. Identification and study build on it."""
