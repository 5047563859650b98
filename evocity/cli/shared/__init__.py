"""What several commands share: inputs, options, parameters, progress."""
