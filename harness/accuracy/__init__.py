"""Accuracy: the error of a result, estimated from the same run with other steps."""
