"""What a lattice, or a file, is: measured, drawn, and put on one page that needs nothing else."""
