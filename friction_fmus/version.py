"""Version of the distribution and the time of its release."""

VERSION = "0.1.0"
RELEASED = "2026-11-20T00:00:00Z"
