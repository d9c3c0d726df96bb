"""Records of measured motion and force: reading, units, sampling, and checks of the excitation."""
