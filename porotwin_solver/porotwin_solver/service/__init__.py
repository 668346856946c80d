"""What the node of the solver needs beside the model: turns and effects in force."""
