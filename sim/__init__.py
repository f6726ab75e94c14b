"""One simulated scene: its stage, camera, lamp and operator."""
