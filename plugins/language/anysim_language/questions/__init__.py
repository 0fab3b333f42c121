"""Questions about episodes, with answers from privileged state; each family in a module with what it leaves unasked."""
