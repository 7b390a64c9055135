"""faceambig."""
