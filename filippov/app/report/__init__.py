"""Studies: everything that is computed for one model, as a report, figures, tables and a summary."""
