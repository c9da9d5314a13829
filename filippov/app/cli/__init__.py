"""What the commands of `filippov` do; each is imported when it is asked for (see `filippov.app.cli.main`)."""
