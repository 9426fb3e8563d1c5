"""What several test folders share: specs to test on, and witnesses that share no code with the package."""
