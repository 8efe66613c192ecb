"""Contracts of scenarios, drivers and backends."""
