"""Experiments on bare filters, without roles and messages: many runs as one array operation."""
