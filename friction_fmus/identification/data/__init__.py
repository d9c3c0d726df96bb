"""Records of measured motion and force: reading, units, sampling, and what they can identify."""
