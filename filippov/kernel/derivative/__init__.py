"""Derivatives of plain functions: exact ones by dual numbers, else differences."""
