"""What every room needs: errors, names, statuses, text and whole files."""
