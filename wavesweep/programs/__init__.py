"""`paper` and `bench`, the programs beside the package."""
