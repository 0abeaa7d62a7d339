"""From a classified volume to a VDI: march, merge and pack."""
