"""Controller gains: contraction of the event map, maps over gains, tuning."""
