"""``python -m ellipsoid_coupling``."""

from ellipsoid_coupling.cli import main

if __name__ == "__main__":
    main()
