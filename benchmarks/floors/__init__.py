"""The least that a machine could take for a stage: its rates, what rays meet, the work of that."""
