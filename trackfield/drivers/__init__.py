"""Drivers: what runs roles, as processes over Zenoh or all together in virtual time."""
