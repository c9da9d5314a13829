"""Verdicts where the linear part does not decide: theorems with hypotheses that are checked one by one."""
