"""How far engines agree: the same world, seeds and actions on several of them, and the gap layer by layer."""
