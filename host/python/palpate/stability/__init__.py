"""What a servo of this kind can render without creating energy: `palpate bench stability`."""
