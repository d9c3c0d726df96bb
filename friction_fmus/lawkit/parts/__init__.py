"""Expressions shared by groups of laws, one module per group."""
