"""What changes of a structure do to its parameters and to its frequencies."""
