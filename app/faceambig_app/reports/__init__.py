"""Results of commands as files: a fitted photograph, pictures of curves and faces, what experiments found."""
