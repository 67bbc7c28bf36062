"""Pictures without a graphics card: for notebooks, the report and the README."""
