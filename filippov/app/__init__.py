"""The command, banks of cases and studies: the only code that sees both models and analysis."""
