//! Nakamura et al.: the transform between a mixed-reality headset and a robot by Semantic-ICP.
