"""The report of a study: one HTML page that needs no other file and no network."""

from .page import report_html, write_report

__all__ = ["report_html", "write_report"]
