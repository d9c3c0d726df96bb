"""The report of a study: one self-contained HTML page."""

from .page import report_html, write_report

__all__ = ["report_html", "write_report"]
