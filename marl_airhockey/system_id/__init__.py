"""Success of policies with other physics, and identification of physics parameters."""
