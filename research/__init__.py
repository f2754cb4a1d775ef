"""How the leg was found. In the repository only: no part of the package."""
