"""Plain programs f(t, y): what switches in their source, the System that they mean, and a run of both."""
