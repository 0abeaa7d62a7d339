"""The mapper and the actor: how a VDI gets into a render window."""
